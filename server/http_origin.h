/// Pages of other origins that a browser lets use the service (CORS, as the Fetch standard has it).
#pragma once

#include <httplib.h>

#include <set>
#include <string>

namespace radbake::server {

class Origins {
 public:
  explicit Origins(std::set<std::string> allowed) : allowed_(std::move(allowed)) {}

  /// A browser asks whether such a page may make such a request.
  bool IsPreflight(const httplib::Request& request) const;
  /// Answers it with 204.
  void AnswerPreflight(const httplib::Request& request, httplib::Response& response) const;
  /// Lets such a page read the answer; nothing for all others.
  void Allow(const httplib::Request& request, httplib::Response& response) const;

 private:
  std::set<std::string> allowed_;
};

}  // namespace radbake::server
