/// What goes wrong, as RFC 9457 says it: in the body of an error answer, and in a job that failed.
#pragma once

#include <chrono>
#include <exception>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <utility>

namespace radbake::server {

struct Problem {
  int status = 500;   ///< the HTTP status; of a failed job: what a request would get that asks for its result
  std::string type;   ///< a URN of the kind, or "about:blank" where the status says it all
  std::string title;  ///< the kind in words, the same each time
  std::string detail;                   ///< this case: one sentence that names what is wrong and where
  std::chrono::seconds retry_after{1};  ///< of a 429 or 503, which are worth another try
  std::string log = {};                 ///< of a bake that failed: the last that it said, in lines
};

/// A plain HTTP error: type "about:blank", the status' own phrase as title.
Problem HttpProblem(int status, std::string detail);
Problem BadParameters(std::string detail);  ///< 422
Problem BadScene(std::string detail);       ///< 422
Problem BadUpload(std::string detail);      ///< 422: parts that are missing, twice there or badly named
Problem TooLarge(std::string detail);       ///< 413
Problem KeyReused(std::string detail);      ///< 422: an idempotency key with another payload
Problem NoResult(std::string detail);       ///< 409: the job has not succeeded (yet)
Problem AlreadyEnded(std::string detail);   ///< 409
Problem BeyondLimit(std::string detail);    ///< 422: the bake took more than a job may take
Problem BakeFailed(std::string detail);     ///< 500: no fault of the upload's that we know of

/// Bytes that are not UTF-8 are replaced: every answer is valid JSON.
std::string ToText(const nlohmann::json& json);

nlohmann::json ToJson(const Problem& problem);
/// Throws nlohmann::json::exception where ToJson() did not write it.
Problem ProblemFromJson(const nlohmann::json& json);

/// Thrown where a request cannot go on; becomes the answer.
class ProblemError : public std::exception {
 public:
  explicit ProblemError(Problem problem) : problem_(std::move(problem)) {}
  const Problem& problem() const { return problem_; }
  const char* what() const noexcept override { return problem_.detail.c_str(); }

 private:
  Problem problem_;
};

/// Text of a stranger's for use inside a detail or a log line: quoted, shortened, control characters
/// replaced.
std::string Quoted(std::string_view text);

}  // namespace radbake::server
