/// The clock of a bake.
#pragma once

#include <algorithm>
#include <chrono>
#include <ctime>
#include <optional>
#include <utility>

#include "solver/radbake.h"

namespace radbake {

/// Of all threads of the process, so far. Unlike the time on the wall it knows no other process.
inline double ProcessorSeconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

/// Tells the caller, keeps the clock, and decides when time is up.
class Watch {
 public:
  Watch(const Parameters& parameters, const ProgressCallback& callback)
      : budget_(parameters.time_budget), callback_(callback) {}

  double Seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

  /// Reports, but not more often than a few times a second within one phase. Throws Interrupted.
  void Report(std::string_view phase, double fraction) {
    progress_.seconds = Seconds();
    progress_.fraction = std::max(progress_.fraction, fraction);
    constexpr double kInterval = 0.1;
    if (callback_ &&
        (phase != progress_.phase || fraction >= 1 || progress_.seconds >= last_report_ + kInterval)) {
      progress_.phase = phase;
      last_report_ = progress_.seconds;
      if (callback_(progress_) == Continue::kStop) {
        throw Interrupted();
      }
    }
  }

  bool Beyond(double share) const { return budget_ && Seconds() > share * *budget_; }
  Progress& progress() { return progress_; }

  /// Seconds since the last call: the phase that just ended.
  double Lap() {
    const double now = Seconds();
    return now - std::exchange(lap_, now);
  }

 private:
  std::optional<double> budget_;
  const ProgressCallback& callback_;
  Progress progress_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  double last_report_ = -1;
  double lap_ = 0;
};

/// Adds up where time goes, by phase.
class Phases {
 public:
  Phases(Watch& watch, Statistics& statistics) : watch_(watch), statistics_(statistics) {}

  /// What was done since the last end.
  void End(const char* name) { Sum(statistics_.seconds, name) += watch_.Lap(); }

  void EndOfRays(const char* name, double ray_seconds) {
    End(name);
    const double before = std::exchange(processor_seconds_, ProcessorSeconds());
    const double rays_before = std::exchange(statistics_.ray_seconds, ray_seconds);
    Sum(processor_, name) += processor_seconds_ - before;
    Sum(rays_, name) += ray_seconds - rays_before;
  }

  void Finish() {
    double all = 0;
    double all_rays = 0;
    for (const auto& [name, spent] : processor_) {
      statistics_.ray_shares.emplace_back(name, spent > 0 ? Sum(rays_, name) / spent : 0);
      all += spent;
      all_rays += Sum(rays_, name);
    }
    statistics_.ray_shares.emplace_back("all", all > 0 ? all_rays / all : 0);
  }

 private:
  using Sums = std::vector<std::pair<std::string, double>>;
  static double& Sum(Sums& sums, const std::string& name) {
    const auto found = std::ranges::find(sums, name, &Sums::value_type::first);
    return found != sums.end() ? found->second : sums.emplace_back(name, 0.0).second;
  }

  Watch& watch_;
  Statistics& statistics_;
  double processor_seconds_ = ProcessorSeconds();
  Sums processor_;
  Sums rays_;
};

}  // namespace radbake
