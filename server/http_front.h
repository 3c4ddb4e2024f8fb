/// Collects the heads of requests from any number of connections in one thread, so that a client that sends
/// none, or sends it slowly, holds nothing but its socket.
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
  /// Drops the connections whose head has not come. No Take() may follow.
  void Stop();
  std::size_t connections() const;

 private:
  struct Waiting {
    Incoming incoming;
    std::chrono::steady_clock::time_point deadline;
  };

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
