/// Who holds a job for too long without a sign of life. By this process' monotonic clock alone: nothing here
/// knows the time of day, nor that of another machine.
#pragma once

#include <chrono>
#include <map>
#include <string>
#include <vector>

#include "server/queue.h"

namespace radbake::server {

class LeaseWatch {
 public:
  using Clock = std::chrono::steady_clock;

  explicit LeaseWatch(std::chrono::milliseconds lease) : lease_(lease) {}

  /// `held`: all that is held now. Those of it that have not beaten for a lease. A time in which nobody
  /// looked counts for a third of a lease at most: when this process was halted or the database was away,
  /// those who hold jobs may have been so too.
  std::vector<Held> Lapsed(const std::vector<Held>& held, Clock::time_point now);

 private:
  struct Seen {
    Held held;
    Clock::duration silent;
  };

  std::chrono::milliseconds lease_;
  Clock::time_point looked_;
  std::map<std::string, Seen> seen_;  ///< by the job's id
};

}  // namespace radbake::server
