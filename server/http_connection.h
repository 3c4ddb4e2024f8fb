/// One accepted connection: the head of its request, taken within limits and made harmless, and the rest as
/// httplib reads and writes it.
#pragma once

#include <httplib.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "server/files.h"
#include "server/http_limits.h"
#include "server/places.h"
#include "server/problem.h"
#include "server/stop_signal.h"

namespace radbake::server {

/// An accepted socket, counted among the connections as long as it lives.
struct ClientSocket {
  Descriptor descriptor;
  Place place;
};

/// A connection whose head is there (`bytes` begins with it), or whose head is refused.
struct Incoming {
  ClientSocket socket;
  std::string bytes;
  std::optional<Problem> refused;
};

/// Where the head ends in what was received: after its empty line. Nothing: it has not ended. Throws
/// ProblemError (431) as soon as it is beyond the limits.
std::optional<std::size_t> HeadEnd(std::string_view bytes, const HttpLimits& limits);

/// The head as httplib gets it. What it would act upon by itself, and badly, comes under another name: ranges
/// (it would cut any answer, errors too, and read them with a recursive matcher), encodings (it would unpack
/// bodies without limit), and the body's type (it would hold without limit what is no multipart). What a
/// client could forge (REMOTE_ADDR, and those names) is left out, and so is an X-Request-Id that is none or
/// not the first. Throws ProblemError (400) for what is no header.
std::string Harmless(std::string_view head);

/// The same head with an X-Request-Id of our own, unless it has one.
std::string Identified(std::string head);
inline constexpr const char* kRequestId = "X-Request-Id";

/// The value of a header that the client has sent, also of those that Harmless() has renamed; empty: none.
std::string Header(const httplib::Request& request, const std::string& name);
std::size_t HeaderCount(const httplib::Request& request, const std::string& name);

/// A header of the server's own, for a request that it makes itself: no client can send it.
std::string OwnHeader(const std::string& name);

/// Reads until the client is too slow for the limits, then no more; and writes likewise.
class Connection final : public httplib::Stream {
 public:
  /// `slow` has the places of those that wait for their client to read: where none is left, nobody waits, and
  /// the answer breaks off. Nobody waits for a client any more when `over` is raised. Both must outlive this
  /// object.
  Connection(Incoming incoming, const HttpLimits& limits, Places& slow, const StopSignal& over);

  bool is_readable() const override { return true; }
  bool is_writable() const override { return true; }
  ssize_t read(char* bytes, std::size_t size) override;
  using httplib::Stream::write;
  ssize_t write(const char* bytes, std::size_t size) override;
  void get_remote_ip_and_port(std::string& ip, int& port) const override;
  void get_local_ip_and_port(std::string& ip, int& port) const override;
  /// None that httplib may use by itself.
  socket_t socket() const override { return -1; }  // NOLINT(readability-identifier-naming)

  /// Bytes that were read and written, with the head of the request.
  std::uint64_t received() const { return head_ + in_.bytes; }
  std::uint64_t sent() const { return out_.bytes; }
  const HttpLimits& limits() const { return limits_; }
  /// The client was too slow to send.
  bool late() const { return in_.late; }
  /// Takes a place of the slow now, for an answer that is likely to need one. False if there is none.
  bool MayBeSlow();
  /// From now on what is written is forgotten: somebody else answers.
  void Mute() { muted_ = true; }
  /// The request has been read to its end.
  void SetHeard() { heard_ = true; }
  bool heard() const { return heard_; }
  ClientSocket TakeSocket() { return std::move(socket_); }

 private:
  using Clock = std::chrono::steady_clock;
  /// How much has moved in one direction, and since when.
  struct Flow {
    std::optional<Clock::time_point> since;
    std::uint64_t bytes = 0;
    bool late = false;
  };
  bool Wait(short events, Flow& flow);

  ClientSocket socket_;
  HttpLimits limits_;
  Places& slow_;
  const StopSignal& over_;
  Place slow_place_;
  std::string buffer_;
  std::size_t head_;
  std::size_t taken_ = 0;  ///< of the buffer
  std::size_t line_ = 0;   ///< bytes taken one by one since the last line break
  Flow in_;
  Flow out_;
  bool muted_ = false;
  bool heard_ = false;
};

}  // namespace radbake::server
