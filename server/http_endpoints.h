/// The resources of the service. Each answer is made as: parse, validate, call.
#pragma once

#include <httplib.h>

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "server/http_request.h"
#include "server/http_watchers.h"
#include "server/jobs.h"
#include "server/tokens.h"

namespace radbake::server {

/// What becomes of the connection after the answer.
struct Then {
  enum class Kind {
    kClose,
    kWatch,  ///< the answer was the head of a stream of events
    kHold    ///< there is no answer yet: `request` is asked instead when the job has ended
  };
  Kind kind = Kind::kClose;
  Place place;
  std::string job;
  std::string last;     ///< the event that the watcher has seen
  std::string request;  ///< a head
  std::chrono::steady_clock::time_point deadline;
};

void Answer(httplib::Response& response, const Problem& problem);
/// The same, with the headers that go with a refusal of this request.
void Refuse(const httplib::Request& request, httplib::Response& response, const Problem& problem);

/// True for the request of a held POST, which is asked as the GET of its job.
bool IsHeldPost(const httplib::Request& request);

/// Thread-safe.
class Endpoints {
 public:
  /// The jobs and the watchers must outlive this object.
  /// Without tokens everybody is the same client.
  /// `connections` says how many there are.
  Endpoints(Jobs& jobs, Watchers& watchers, const HttpLimits& limits, std::shared_ptr<const Tokens> tokens,
            std::function<std::size_t()> connections)
      : jobs_(jobs),
        watchers_(watchers),
        limits_(limits),
        tokens_(std::move(tokens)),
        connections_(std::move(connections)),
        rate_(limits.uploads_a_minute),
        uploads_(limits.uploads) {}

  /// Throws ProblemError for what is wrong with the request before its body is read. Returns whose it is.
  std::string Check(const httplib::Request& request) const;
  /// Answers. Throws ProblemError where it cannot, and std::exception where the server fails.
  Then Serve(const httplib::Request& request, httplib::Response& response, Connection& connection,
             Body& body);

 private:
  Then Post(const httplib::Request& request, httplib::Response& response, Body& body,
            const std::string& owner);
  void Ready(httplib::Response& response);
  void ShowMetrics(httplib::Response& response);
  void List(const httplib::Request& request, httplib::Response& response, const std::string& owner);
  Then ServeJob(const httplib::Request& request, httplib::Response& response, const Target& target,
                const std::string& owner);
  Then Get(const httplib::Request& request, httplib::Response& response, const Job& job);
  Then Watch(const httplib::Request& request, httplib::Response& response, const Job& job);
  void Cancel(httplib::Response& response, const Job& job);
  Then Hold(const httplib::Request& request, const Job& job, int status);
  void CheckQuota(const std::string& owner);
  Job Need(const std::string& id, const std::string& owner);

  Jobs& jobs_;
  Watchers& watchers_;
  HttpLimits limits_;
  std::shared_ptr<const Tokens> tokens_;
  std::function<std::size_t()> connections_;
  Rate rate_;
  Places uploads_;
};

}  // namespace radbake::server
