#include "server/http_request.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <exception>
#include <utility>

#include "server/http_assets.h"
#include "server/multipart.h"
#include "server/problem.h"

namespace radbake::server {
namespace {

constexpr std::size_t kLongestTarget = 1024;
constexpr std::int64_t kLongestWait = 60;

bool IsId(std::string_view text) {
  return text.size() == 32 && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

bool Allows(Resource resource, std::string_view method) {
  std::string_view allowed = Allowed(resource);
  while (!allowed.empty()) {
    const std::string_view one = allowed.substr(0, allowed.find(", "));
    if (one == method) {
      return true;
    }
    allowed.remove_prefix(std::min(one.size() + 2, allowed.size()));
  }
  return false;
}

bool IsNumber(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos;
}

bool IsChunked(const httplib::Request& request) {
  return request.get_header_value("Transfer-Encoding") == "chunked";
}

}  // namespace

Target ParsePath(std::string_view path) {
  constexpr std::string_view kBakes = "/v1/bakes";
  constexpr std::array<std::pair<std::string_view, Resource>, 6> kParts = {
      {{"", Resource::kBake},
       {"/cancel", Resource::kCancel},
       {"/scene", Resource::kScene},
       {"/statistics", Resource::kStatistics},
       {"/lightmap", Resource::kLightmap},
       {"/events", Resource::kEvents}}};
  for (const Resource resource :
       {Resource::kHealth, Resource::kReady, Resource::kMetrics, Resource::kBakes}) {
    if (path == Route(resource)) {
      return {resource, ""};
    }
  }
  if (Assets().contains(path)) {
    return {Resource::kAsset, ""};
  }
  if (!path.starts_with(kBakes) || path.substr(kBakes.size(), 1) != "/") {
    return {};
  }
  path.remove_prefix(kBakes.size() + 1);
  const std::size_t end = std::min(path.find('/'), path.size());
  for (const auto& [part, resource] : kParts) {
    if (IsId(path.substr(0, end)) && path.substr(end) == part) {
      return {resource, std::string(path.substr(0, end))};
    }
  }
  return {};
}

std::string_view Route(Resource resource) {
  switch (resource) {
    case Resource::kNone:
      return "other";
    case Resource::kHealth:
      return "/healthz";
    case Resource::kReady:
      return "/readyz";
    case Resource::kMetrics:
      return "/metrics";
    case Resource::kAsset:
      return "page";
    case Resource::kBakes:
      return "/v1/bakes";
    case Resource::kBake:
      return "/v1/bakes/{id}";
    case Resource::kCancel:
      return "/v1/bakes/{id}/cancel";
    case Resource::kScene:
      return "/v1/bakes/{id}/scene";
    case Resource::kStatistics:
      return "/v1/bakes/{id}/statistics";
    case Resource::kLightmap:
      return "/v1/bakes/{id}/lightmap";
    case Resource::kEvents:
      return "/v1/bakes/{id}/events";
  }
  return "";
}

std::string_view Allowed(Resource resource) {
  switch (resource) {
    case Resource::kNone:
      return "";
    case Resource::kBakes:
      return "GET, HEAD, POST";
    case Resource::kCancel:
      return "POST";
    case Resource::kBake:
      return "GET, HEAD, DELETE";
    case Resource::kHealth:
    case Resource::kReady:
    case Resource::kMetrics:
    case Resource::kAsset:
    case Resource::kScene:
    case Resource::kStatistics:
    case Resource::kLightmap:
    case Resource::kEvents:
      return "GET, HEAD";
  }
  return "";
}

std::string MediaType(std::string_view content_type) {
  std::string type(content_type.substr(0, content_type.find_first_of("; \t")));
  std::transform(type.begin(), type.end(), type.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return type;
}

void CheckHead(const httplib::Request& request, std::uint64_t max_upload) {
  if (request.target.size() > kLongestTarget) {
    throw ProblemError(HttpProblem(414, "the request's target is longer than 1024 bytes"));
  }
  const Resource resource = ParsePath(request.path).resource;
  if (resource == Resource::kNone) {
    throw ProblemError(HttpProblem(404, "there is nothing at " + Quoted(request.path)));
  }
  if (!Allows(resource, request.method)) {
    throw ProblemError(
        HttpProblem(405, request.method + " is not allowed here, only " + std::string(Allowed(resource))));
  }
  if (resource != Resource::kBakes || request.method != "POST") {
    return;
  }
  const std::string type = Header(request, "Content-Type");
  const bool multipart = MediaType(type) == "multipart/form-data";
  if (!multipart && MediaType(type) != "model/gltf-binary" && MediaType(type) != "application/octet-stream") {
    throw ProblemError(HttpProblem(
        415, "the body is " + (type.empty() ? "of no type" : Quoted(type)) +
                 ", and must be multipart/form-data, model/gltf-binary or application/octet-stream"));
  }
  if (HeaderCount(request, "Content-Encoding") > 0 && Header(request, "Content-Encoding") != "identity") {
    throw ProblemError(HttpProblem(415, "the body must come without a Content-Encoding"));
  }
  if (multipart && MultipartBoundary(type).empty()) {
    throw ProblemError(HttpProblem(400, "the Content-Type names no boundary of 1 to 70 characters"));
  }
  if (request.has_header("Transfer-Encoding")) {
    if (!IsChunked(request) || request.get_header_value_count("Transfer-Encoding") > 1) {
      throw ProblemError(HttpProblem(400, "the only Transfer-Encoding taken is \"chunked\""));
    }
    if (request.has_header("Content-Length")) {
      throw ProblemError(HttpProblem(400, "the request has both Transfer-Encoding and Content-Length"));
    }
    return;
  }
  if (!request.has_header("Content-Length")) {
    throw ProblemError(HttpProblem(411, "the request has neither Content-Length nor Transfer-Encoding"));
  }
  const std::string length = request.get_header_value("Content-Length");
  if (request.get_header_value_count("Content-Length") > 1 || !IsNumber(length)) {
    throw ProblemError(HttpProblem(400, "Content-Length is no number of bytes"));
  }
  if (length.size() > 19 || std::stoull(length) > max_upload) {
    throw ProblemError(
        TooLarge("the body has " + length + " bytes, at most " + std::to_string(max_upload) + " are taken"));
  }
}

std::optional<std::chrono::seconds> PreferredWait(const httplib::Request& request) {
  std::string_view preferences;
  const std::string header = request.get_header_value("Prefer");
  for (preferences = header; !preferences.empty();) {
    const std::size_t end = std::min(preferences.find_first_of(",;"), preferences.size());
    std::string_view one = preferences.substr(0, end);
    preferences.remove_prefix(std::min(end + 1, preferences.size()));
    one.remove_prefix(std::min(one.find_first_not_of(' '), one.size()));
    one = one.substr(0, one.find_last_not_of(' ') + 1);
    constexpr std::string_view kWait = "wait=";
    if (one.starts_with(kWait) && IsNumber(one.substr(kWait.size())) && one.size() < 12) {
      const std::int64_t wait = std::stoll(std::string(one.substr(kWait.size())));
      return std::chrono::seconds(std::min(wait, kLongestWait));
    }
  }
  return std::nullopt;
}

Body::Body(const httplib::Request& request, const httplib::ContentReader* reader, Connection& connection,
           const std::atomic<bool>& stopping)
    : connection_(connection), stopping_(stopping) {
  const std::string length = request.get_header_value("Content-Length");
  if (IsChunked(request) || (IsNumber(length) && length != "0")) {
    reader_ = reader;
  } else {
    connection_.SetHeard();
  }
}

void Body::Read(std::uint64_t most, const std::function<void(std::string_view)>& take) {
  if (reader_ == nullptr) {
    return;
  }
  const httplib::ContentReader& reader = *std::exchange(reader_, nullptr);
  std::uint64_t taken = 0;
  std::exception_ptr error;
  const bool whole = reader([&](const char* data, std::size_t size) {
    try {
      taken += size;
      if (taken > most) {
        throw ProblemError(
            TooLarge("the body has more than the " + std::to_string(most) + " bytes that are taken"));
      }
      take({data, size});
    } catch (...) {
      error = std::current_exception();
    }
    return !error && !stopping_;
  });
  if (error) {
    std::rethrow_exception(error);
  }
  if (!whole && stopping_) {
    throw ProblemError(HttpProblem(503, "the server is stopping"));
  }
  if (!whole && connection_.late()) {
    const HttpLimits& limits = connection_.limits();
    throw ProblemError(HttpProblem(
        408, "the body comes too slowly: it has stood still for " + std::to_string(limits.idle_time.count()) +
                 " seconds, or is that far behind " + std::to_string(limits.least_rate) + " bytes a second"));
  }
  if (!whole) {
    throw ProblemError(HttpProblem(400, "the body breaks off"));
  }
  connection_.SetHeard();
}

}  // namespace radbake::server
