/// How much of what the service takes from its clients. Each refusal names the limit.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

namespace radbake::server {

struct HttpLimits {
  std::size_t connections = 1000;      ///< at a time
  std::size_t head = 16384;            ///< bytes of a request's line and headers
  std::size_t headers = 64;            ///< their number
  std::chrono::seconds head_time{10};  ///< from a connection's begin to the end of the head
  std::chrono::seconds idle_time{10};  ///< between two bytes of a body or an answer
  std::uint64_t least_rate = 1000;     ///< bytes a second that a body or an answer must move, on average

  std::uint64_t upload = 256ULL << 20U;  ///< bytes of a body
  int parts = 1000;                      ///< of a form
  std::size_t uploads = 24;              ///< bodies that are read at a time
  std::size_t downloads = 24;  ///< results that are sent at a time, and other answers to slow readers

  int uploads_a_minute = 0;            ///< of each client; 0: as many as it likes
  std::size_t queued = 10'000;         ///< jobs that wait, of all clients
  std::size_t queued_of_one = 10'000;  ///< jobs that wait, of each client

  std::size_t watchers = 500;        ///< streams of events and held answers at a time, together
  std::chrono::seconds comment{15};  ///< between two signs of life of a stream
};

}  // namespace radbake::server
