#include "server/http_endpoints.h"

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "server/http_assets.h"
#include "server/http_connection.h"
#include "server/http_result.h"
#include "server/multipart.h"
#include "server/problem.h"
#include "server/upload.h"

namespace radbake::server {
namespace {

using httplib::Request;
using httplib::Response;

constexpr std::size_t kLongestKey = 255;
constexpr std::size_t kLargestPage = 1000;

// Of a held request: the status that its first answer would have had, and how long it may have been held.
const std::string kHeldStatus = OwnHeader("Held-Status");
const std::string kHeldFor = OwnHeader("Held-For");

void SetRetryAfter(Response& response, const Job& job) {
  if (!Ended(job.status)) {
    response.set_header("Retry-After", "1");
  }
}

void Answer(Response& response, int status, const Job& job) {
  response.status = status;
  response.set_content(ToText(ToJson(job)), "application/json");
  SetRetryAfter(response, job);
}

ProblemError UnknownJob() {
  return ProblemError(HttpProblem(404, "there is no such job"));
}

std::optional<IdempotencyKey> ReadKey(const Request& request) {
  if (!request.has_header("Idempotency-Key")) {
    return std::nullopt;
  }
  std::string key = request.get_header_value("Idempotency-Key");
  const bool visible = std::all_of(key.begin(), key.end(), [](char c) { return c > 0x20 && c < 0x7F; });
  if (key.empty() || key.size() > kLongestKey || !visible) {
    throw ProblemError(HttpProblem(400, "Idempotency-Key takes 1 to 255 visible ASCII characters"));
  }
  return IdempotencyKey{std::move(key), ""};
}

Page ReadPage(const Request& request) {
  Page page;
  for (const auto& [name, value] : request.params) {
    if (name == "status") {
      page.status = StatusFrom(value);
      if (!page.status) {
        throw ProblemError(HttpProblem(
            400,
            "status is " + Quoted(value) + ", and takes queued, running, succeeded, failed or canceled"));
      }
    } else if (name == "limit") {
      const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), page.limit);
      if (error != std::errc() || end != value.data() + value.size() || page.limit < 1 ||
          page.limit > kLargestPage) {
        throw ProblemError(HttpProblem(400, "limit is " + Quoted(value) + ", and takes 1 to 1000"));
      }
    } else if (name == "after") {
      page.after = value;
      if (!IsCursor(value)) {
        throw ProblemError(
            HttpProblem(400, "after is " + Quoted(value) + ", and takes what a page gave as its next"));
      }
    } else {
      throw ProblemError(
          HttpProblem(400, "there is no parameter " + Quoted(name) + ", only status, limit and after"));
    }
  }
  return page;
}

void ReadBody(const Request& request, Body& body, std::uint64_t most, Upload& upload) {
  const std::string boundary = MultipartBoundary(Header(request, "Content-Type"));
  if (boundary.empty()) {
    upload.BeginPart("scene", "");
    body.Read(most, [&](std::string_view bytes) { upload.Append(bytes); });
    upload.EndPart();
    return;
  }
  MultipartParser parser(
      boundary, {[&](const MultipartParser::Part& part) { upload.BeginPart(part.name, part.filename); },
                 [&](std::string_view bytes) { upload.Append(bytes); }, [&] { upload.EndPart(); }});
  body.Read(most, [&](std::string_view bytes) { parser.Feed(bytes); });
  parser.End();
}

}  // namespace

bool IsHeldPost(const Request& request) {
  return request.get_header_value(kHeldStatus) == "202";
}

void Answer(Response& response, const Problem& problem) {
  response.status = problem.status;
  response.set_content(ToText(ToJson(problem)), "application/problem+json");
  if (problem.status == 503 || problem.status == 429) {
    response.set_header("Retry-After", std::to_string(problem.retry_after.count()));
  }
  if (problem.status == 401) {
    response.set_header("WWW-Authenticate", "Bearer");
  }
}

void Refuse(const Request& request, Response& response, const Problem& problem) {
  Answer(response, problem);
  if (problem.status == 405) {
    response.set_header("Allow", std::string(Allowed(ParsePath(request.path).resource)));
  }
}

std::string Endpoints::Check(const Request& request) const {
  CheckHead(request, limits_.upload);
  const Resource resource = ParsePath(request.path).resource;
  const bool watched =
      resource == Resource::kHealth || resource == Resource::kReady || resource == Resource::kMetrics;
  if (jobs_.role() == Role::kWorker && !watched) {
    throw ProblemError(HttpProblem(404, "this radbaked bakes, and answers for no job"));
  }
  if (tokens_ == nullptr || resource == Resource::kHealth || resource == Resource::kReady ||
      resource == Resource::kAsset) {
    return "";
  }
  std::optional<std::string> owner = tokens_->Owner(request.get_header_value("Authorization"));
  if (!owner) {
    throw ProblemError(HttpProblem(401, "the request carries no token that is known here"));
  }
  return std::move(*owner);
}

void Endpoints::CheckQuota(const std::string& owner) {
  const Waiting waiting = jobs_.CountQueued(owner);
  if (waiting.all >= limits_.queued) {
    throw ProblemError(
        HttpProblem(503, "there are the " + std::to_string(limits_.queued) + " jobs already that may wait"));
  }
  if (waiting.of_owner >= limits_.queued_of_one) {
    throw ProblemError(HttpProblem(
        429, "you have the " + std::to_string(limits_.queued_of_one) + " jobs already that may wait"));
  }
  if (const auto wait = rate_.Take(owner, Rate::Clock::now())) {
    Problem problem = HttpProblem(429, "you have made the " + std::to_string(limits_.uploads_a_minute) +
                                           " uploads a minute that you may");
    problem.retry_after = *wait;
    throw ProblemError(std::move(problem));
  }
}

Then Endpoints::Serve(const Request& request, Response& response, Connection& connection, Body& body) {
  const std::string owner = Check(request);
  const Target target = ParsePath(request.path);
  if (target.resource == Resource::kBakes && request.method == "POST") {
    return Post(request, response, body, owner);
  }
  if (target.resource == Resource::kScene && request.method == "GET" && !connection.MayBeSlow()) {
    throw ProblemError(HttpProblem(503, "there are the " + std::to_string(limits_.downloads) +
                                            " downloads at a time already that are served"));
  }
  switch (target.resource) {
    case Resource::kHealth:
      response.status = 200;
      response.set_content(R"({"status":"ok"})", "application/json");
      return {};
    case Resource::kReady:
      Ready(response);
      return {};
    case Resource::kMetrics:
      ShowMetrics(response);
      return {};
    case Resource::kAsset:
      SendAsset(request, response, Assets().at(request.path));
      return {};
    case Resource::kBakes:
      List(request, response, owner);
      return {};
    default:
      return ServeJob(request, response, target, owner);
  }
}

Then Endpoints::Post(const Request& request, Response& response, Body& body, const std::string& owner) {
  Submission submission{owner, "", ReadKey(request)};
  CheckQuota(owner);
  const Place place = uploads_.Take();
  if (place == nullptr) {
    throw ProblemError(HttpProblem(503, "there are the " + std::to_string(limits_.uploads) +
                                            " uploads at a time already that are taken"));
  }
  Draft draft = jobs_.Begin();
  Upload upload(draft, limits_.parts);
  ReadBody(request, body, limits_.upload, upload);
  submission.scene = upload.Finish();
  if (submission.key) {
    submission.key->digest = upload.Digest();
  }
  const Added added = jobs_.Submit(std::move(draft), std::move(submission));
  if (added.kind == Added::Kind::kOther) {
    throw ProblemError(
        KeyReused("this Idempotency-Key has come with another payload, for job " + added.job.id));
  }
  const int status = Ended(added.job.status) ? 200 : 202;
  Answer(response, status, added.job);
  response.set_header("Location", "/v1/bakes/" + added.job.id);
  return Hold(request, added.job, status);
}

void Endpoints::Ready(Response& response) {
  if (const std::string trouble = jobs_.Trouble(); !trouble.empty()) {
    throw ProblemError(HttpProblem(503, trouble));
  }
  response.status = 200;
  response.set_content(R"({"status":"ready"})", "application/json");
}

void Endpoints::ShowMetrics(Response& response) {
  Gauges gauges;
  try {
    for (const auto& [status, count] : jobs_.Count()) {
      gauges.jobs[ToString(status)] = count;
    }
  } catch (const QueueError&) {  // NOLINT(bugprone-empty-catch): which the metrics tell
  }
  gauges.connections = connections_();
  gauges.free_bytes = jobs_.FreeBytes();
  response.status = 200;
  response.set_content(jobs_.metrics().Text(gauges), "text/plain; version=0.0.4; charset=utf-8");
}

void Endpoints::List(const Request& request, Response& response, const std::string& owner) {
  Page page = ReadPage(request);
  page.owner = owner;
  ++page.limit;  // one more, to see whether there is a next page
  std::vector<Job> jobs = jobs_.List(page);
  --page.limit;
  nlohmann::json next;
  if (jobs.size() > page.limit) {
    jobs.pop_back();
    next = "/v1/bakes?limit=" + std::to_string(page.limit) + "&after=" + Cursor(jobs.back());
    if (page.status) {
      next = next.get<std::string>() + "&status=" + std::string(ToString(*page.status));
    }
  }
  nlohmann::json bakes = nlohmann::json::array();
  for (const Job& job : jobs) {
    bakes.push_back(ToJson(job));
  }
  response.status = 200;
  response.set_content(ToText({{"bakes", std::move(bakes)}, {"next", std::move(next)}}), "application/json");
}

// Another's job is none.
Job Endpoints::Need(const std::string& id, const std::string& owner) {
  std::optional<Job> job = jobs_.Find(id);
  if (!job || job->owner != owner) {
    throw UnknownJob();
  }
  return std::move(*job);
}

Then Endpoints::ServeJob(const Request& request, Response& response, const Target& target,
                         const std::string& owner) {
  const Job job = Need(target.id, owner);
  const auto send = [&](const Result& result) {
    if (job.status != Status::kSucceeded) {
      SetRetryAfter(response, job);
      const std::string reason = job.problem ? ": " + job.problem->detail : "";
      throw ProblemError(NoResult("the job is " + std::string(ToString(job.status)) + reason));
    }
    if (!SendResult(request, response, result)) {
      throw UnknownJob();  // deleted meanwhile
    }
  };
  switch (target.resource) {
    case Resource::kScene:
      send({jobs_.Open(job.id, kBakedFile), job.id + ".scene", "model/gltf-binary", "baked.glb", false});
      return {};
    case Resource::kStatistics:
      send({jobs_.Open(job.id, kStatisticsFile), job.id + ".statistics", "application/json",
            "statistics.json", true});
      return {};
    case Resource::kLightmap:
      throw ProblemError(HttpProblem(404, "the job has no lightmap: its light is at the scene's vertices"));
    case Resource::kEvents:
      return Watch(request, response, job);
    case Resource::kCancel:
      Cancel(response, job);
      return {};
    default:
      break;
  }
  if (request.method == "DELETE") {
    jobs_.Remove(job.id);
    response.status = 204;
    return {};
  }
  return Get(request, response, job);
}

Then Endpoints::Get(const Request& request, Response& response, const Job& job) {
  if (!request.has_header(kHeldStatus)) {
    Answer(response, 200, job);
    return request.method == "GET" ? Hold(request, job, 200) : Then();
  }
  const bool ended = Ended(job.status);
  Answer(response, ended || request.get_header_value(kHeldStatus) == "200" ? 200 : 202, job);
  response.set_header("Location", "/v1/bakes/" + job.id);
  response.set_header("Preference-Applied", "wait=" + request.get_header_value(kHeldFor));
  return {};
}

Then Endpoints::Watch(const Request& request, Response& response, const Job& job) {
  if (request.method == "HEAD") {
    response.status = 200;
    response.set_header("Content-Type", "text/event-stream");
    return {};
  }
  const std::string last = request.get_header_value("Last-Event-ID");
  if (Ended(job.status) && last == ToEvent(job).id) {
    response.status = 204;  // which tells an EventSource to come no more
    return {};
  }
  Then then{Then::Kind::kWatch, watchers_.Reserve(), job.id, last, "", {}};
  if (!then.place) {
    throw ProblemError(HttpProblem(503, "there are the " + std::to_string(limits_.watchers) +
                                            " watchers at a time already that are taken"));
  }
  response.status = 200;
  response.set_header("X-Accel-Buffering", "no");
  // The head alone: a watcher's events are written elsewhere.
  response.set_content_provider("text/event-stream", [](std::size_t, httplib::DataSink& sink) {
    sink.done();
    return true;
  });
  return then;
}

Then Endpoints::Hold(const Request& request, const Job& job, int status) {
  const std::optional<std::chrono::seconds> wait = PreferredWait(request);
  if (!wait || Ended(job.status)) {
    return {};
  }
  Then then{Then::Kind::kHold, watchers_.Reserve(), job.id, "", "", std::chrono::steady_clock::now() + *wait};
  if (!then.place) {
    return {};  // a preference is no order
  }
  then.request = "GET /v1/bakes/" + job.id + " HTTP/1.1\r\nHost: held\r\n" + kHeldStatus + ": " +
                 std::to_string(status) + "\r\n" + kHeldFor + ": " + std::to_string(wait->count()) + "\r\n";
  for (const char* name : {"Authorization", "Origin", kRequestId}) {
    if (request.has_header(name)) {
      then.request += std::string(name) + ": " + request.get_header_value(name) + "\r\n";
    }
  }
  then.request += "\r\n";
  return then;
}

void Endpoints::Cancel(Response& response, const Job& job) {
  const bool canceled = jobs_.Cancel(job.id);
  const Job now = Need(job.id, job.owner);
  if (!canceled && now.status != Status::kCanceled) {
    throw ProblemError(AlreadyEnded("the job has " + std::string(ToString(now.status)) + " already"));
  }
  Answer(response, 200, now);
}

}  // namespace radbake::server
