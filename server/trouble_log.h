/// Logs a trouble that is met again and again: when it begins, once a minute as long as it is met, and when
/// it is over. Thread-safe.
#pragma once

#include <chrono>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

namespace radbake::server {

class TroubleLog {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::minutes kAgain{1};
  /// Who meets it is one of several that try, and another may have got through meanwhile.
  static constexpr std::chrono::seconds kQuiet{5};

  /// `over`: what is said when it is over.
  explicit TroubleLog(std::string over) : over_(std::move(over)) {}

  void Meet(std::string_view what, Clock::time_point now = Clock::now());
  /// There was none just now: it is over if it has not been met for a while.
  void Miss(Clock::time_point now = Clock::now());

 private:
  std::string over_;
  std::mutex mutex_;
  std::optional<Clock::time_point> met_;  ///< last; nothing: it is over
  Clock::time_point said_;
};

}  // namespace radbake::server
