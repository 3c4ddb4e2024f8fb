/// The files of a job that has succeeded, as HTTP serves what never changes: entity tags, one range, gzip.
#pragma once

#include <httplib.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "server/queue.h"

namespace radbake::server {

/// What a Range header asks for, of something so large.
struct Range {
  enum class Kind {
    kWhole,  ///< there is none, or one that a server may leave unserved: several ranges, another unit
    kPart,
    kNone  ///< nothing of it is there: 416
  };
  Kind kind = Kind::kWhole;
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
};
Range ParseRange(std::string_view header, std::uint64_t size);

/// True if a list of entity tags (If-None-Match) holds this one or "*".
bool HasTag(std::string_view list, std::string_view tag);

/// True if an Accept-Encoding takes gzip.
bool TakesGzip(std::string_view accept_encoding);

std::string Gzip(std::string_view bytes);

struct Result {
  std::shared_ptr<StoredFile> file;  ///< null: it is not there
  std::string tag;                   ///< unquoted; never the same for other bytes
  const char* type = "";
  const char* name = "";    ///< for who saves it
  bool compresses = false;  ///< a text, small enough to be held
};

/// Answers a GET or HEAD of it: 200, 206, 304, or 416. False if the file is not there.
bool SendResult(const httplib::Request& request, httplib::Response& response, const Result& result);

}  // namespace radbake::server
