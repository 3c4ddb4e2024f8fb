/// Collects the heads of requests from any number of connections in one thread, so that a client that sends
/// none, or sends it slowly, holds nothing but its socket; and waits in the same thread for clients that go
/// on sending what nobody reads.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "server/http_connection.h"

namespace radbake::server {

class Front {
 public:
  /// `ready` gets each connection once, from any thread: its head is whole and harmless, or refused (400,
  /// 408, 431, 503). What a client has closed is dropped.
  Front(const HttpLimits& limits, std::function<void(Incoming)> ready);
  ~Front();
  Front(const Front&) = delete;
  Front& operator=(const Front&) = delete;

  /// Takes over an accepted socket.
  void Take(int socket);
  /// Takes over a socket to which an answer was written though the request had not come to its end. It is
  /// closed when the client has closed it, or after a few seconds, of which there are fewer where there are
  /// too many connections: closed before, it would take from the client what that has not read of the answer.
  void Linger(ClientSocket socket);
  /// Drops all connections that it holds, also those to come.
  void Stop();
  std::size_t connections() const;

 private:
  struct Waiting {
    Incoming incoming;
    std::chrono::steady_clock::time_point deadline;
    bool answered = false;
  };

  void Add(Waiting waiting);
  void Loop();
  bool Advance(Incoming& incoming);
  void Wake();

  HttpLimits limits_;
  std::function<void(Incoming)> ready_;
  std::shared_ptr<std::atomic<std::size_t>> count_ = std::make_shared<std::atomic<std::size_t>>(0);
  Descriptor wake_;
  std::mutex mutex_;
  bool stopping_ = false;
  std::vector<Waiting> new_;
  std::thread thread_;
};

}  // namespace radbake::server
