#include "server/trouble_log.h"

#include <spdlog/spdlog.h>

namespace radbake::server {

void TroubleLog::Meet(std::string_view what, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  if (!met_ || now - said_ >= kAgain) {
    spdlog::error("{}: it is tried again", what);
    said_ = now;
  }
  met_ = now;
}

void TroubleLog::Miss(Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  if (met_ && now - *met_ >= kQuiet) {
    spdlog::info("{}", over_);
    met_.reset();
  }
}

}  // namespace radbake::server
