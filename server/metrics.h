/// What the service has done since it started, as Prometheus reads it (text exposition format 0.0.4).
///
/// Names and units follow Prometheus' rules: seconds and bytes, counters end in _total.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

namespace radbake::server {

/// Why a child did not end by itself.
enum class KillReason { kTime, kCpuTime, kFileSize, kMemory, kStopped, kSignal };
std::string_view ToString(KillReason reason);

/// What is so at the moment of asking.
struct Gauges {
  std::map<std::string_view, std::size_t> jobs;  ///< by status; none: the queue cannot be read
  std::size_t connections = 0;
  std::optional<std::uint64_t> free_bytes;  ///< of the disk that holds the jobs; nothing: it is not there
};

/// Thread-safe.
class Metrics {
 public:
  using Seconds = std::chrono::duration<double>;

  void CountRequest(std::string_view route, std::string_view method, int status);
  void CountReceived(std::uint64_t bytes);
  void CountSent(std::uint64_t bytes);
  /// A job is baked for the first time, so long after it was made.
  void CountStart(Seconds queued);
  /// A child has ended, so long after its start; with the rays that it traced, as far as known.
  void CountBake(std::string_view outcome, Seconds baked, std::uint64_t rays);
  void CountKill(KillReason reason);

  std::string Text(const Gauges& gauges) const;

 private:
  /// Counts by upper bounds, as Prometheus sums them up.
  struct Histogram {
    std::vector<std::uint64_t> counts;
    double sum = 0;
    void Add(Seconds value);
    void Write(const std::string& name, const char* help, std::string& text) const;
  };

  mutable std::mutex mutex_;
  std::map<std::tuple<std::string, std::string, int>, std::uint64_t> requests_;
  std::map<std::string, std::uint64_t, std::less<>> bakes_;
  std::map<KillReason, std::uint64_t> kills_;
  std::uint64_t received_ = 0;
  std::uint64_t sent_ = 0;
  std::uint64_t rays_ = 0;
  Histogram queue_seconds_;
  Histogram bake_seconds_;
};

}  // namespace radbake::server
