/// What a request asks for, and what is wrong with it before its body is read; and its body.
#pragma once

#include <httplib.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace radbake::server {

enum class Resource { kNone, kHealth, kBakes, kBake, kCancel, kScene, kStatistics };

struct Target {
  Resource resource = Resource::kNone;
  std::string id;  ///< of a job, where the resource is one's
};

Target ParsePath(std::string_view path);

/// The methods of a resource, as the header Allow lists them.
std::string_view Allowed(Resource resource);

/// Keeps httplib from handling by itself what it handles badly: a multipart body (it would hold without limit
/// what is none; ContentType() still tells the type) and ranges (it would cut any answer, errors too; a
/// server may leave ranges unserved).
void Disarm(httplib::Request& request);

std::string ContentType(const httplib::Request& request);

/// The media type alone, in lower case, without its parameters.
std::string MediaType(std::string_view content_type);

/// Throws ProblemError for what is wrong with a request whatever its body holds.
void CheckHead(const httplib::Request& request, std::uint64_t max_upload);

/// The body of a request, which streams by once.
class Body {
 public:
  /// `reader` may be null: a request whose body nobody reads. Raising `stopping` ends a Read() with a 503.
  Body(const httplib::Request& request, const httplib::ContentReader* reader,
       const std::atomic<bool>& stopping);

  /// Hands over all its bytes. Throws ProblemError if there are more than `most` or if it breaks off, and
  /// whatever `take` throws.
  void Read(std::uint64_t most, const std::function<void(std::string_view)>& take);

  /// Reads and forgets some of what was not read, so that its sender gets to read the answer.
  void Drain();

 private:
  const httplib::ContentReader* reader_ = nullptr;  ///< null: there is nothing (more) to read
  const std::atomic<bool>& stopping_;
};

}  // namespace radbake::server
