/// The log: one JSON object a line on standard error, through spdlog.
///
///     {"time": RFC 3339 in UTC, "level": "info", "message": text, further members of the scopes around it}
#pragma once

#include <cstddef>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <utility>

namespace radbake::server {

/// From now on spdlog writes like this.
void StartLog();

/// What all lines of this thread carry as long as it lives: the ids of the request and the job.
class LogScope {
 public:
  using Member = std::pair<const char*, nlohmann::json>;

  explicit LogScope(std::initializer_list<Member> members);
  ~LogScope();
  LogScope(const LogScope&) = delete;
  LogScope& operator=(const LogScope&) = delete;

 private:
  std::size_t before_;
};

}  // namespace radbake::server
