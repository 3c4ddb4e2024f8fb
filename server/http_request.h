/// What a request asks for, and what is wrong with it before its body is read; and its body.
#pragma once

#include <httplib.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "server/http_connection.h"

namespace radbake::server {

enum class Resource {
  kNone,
  kHealth,
  kReady,
  kMetrics,
  kAsset,
  kBakes,
  kBake,
  kCancel,
  kScene,
  kStatistics,
  kLightmap,
  kEvents
};

struct Target {
  Resource resource = Resource::kNone;
  std::string id;  ///< of a job, where the resource is one's
};

Target ParsePath(std::string_view path);

/// A resource's path with {id} for the job, for who counts requests; "other" for none.
std::string_view Route(Resource resource);

/// The methods of a resource, as the header Allow lists them.
std::string_view Allowed(Resource resource);

/// The media type alone, in lower case, without its parameters.
std::string MediaType(std::string_view content_type);

/// Throws ProblemError for what is wrong with a request whatever its body holds.
void CheckHead(const httplib::Request& request, std::uint64_t max_upload);

/// How long the client would rather wait for the job's end (Prefer: wait=N, RFC 7240), a minute at most.
std::optional<std::chrono::seconds> PreferredWait(const httplib::Request& request);

/// The body of a request, which streams by once.
class Body {
 public:
  /// `reader` may be null: a request whose body nobody reads. Raising `stopping` ends a Read() with a 503.
  Body(const httplib::Request& request, const httplib::ContentReader* reader, Connection& connection,
       const std::atomic<bool>& stopping);

  /// Hands over all its bytes. Throws ProblemError if there are more than `most` (413), if it breaks off
  /// (400) or comes too slowly (408), and whatever `take` throws; then the rest is not read.
  void Read(std::uint64_t most, const std::function<void(std::string_view)>& take);

 private:
  const httplib::ContentReader* reader_ = nullptr;  ///< null: there is nothing (more) to read
  Connection& connection_;
  const std::atomic<bool>& stopping_;
};

}  // namespace radbake::server
