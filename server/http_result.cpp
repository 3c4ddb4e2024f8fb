#include "server/http_result.h"

#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <memory>
#include <stdexcept>

#include "server/http_connection.h"
#include "server/problem.h"
#include "server/text.h"

namespace radbake::server {
namespace {

constexpr std::size_t kPieceSize = 65536;

// The elements of a comma-separated list, one after the other.
std::string_view NextOf(std::string_view& list) {
  const std::size_t comma = std::min(list.find(','), list.size());
  const std::string_view one = Trimmed(list.substr(0, comma));
  list.remove_prefix(std::min(comma + 1, list.size()));
  return one;
}

// The whole text is one number.
std::optional<std::uint64_t> Number(std::string_view text) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole ? std::optional(number) : std::nullopt;
}

void Replace(httplib::Response& response, const char* name, const std::string& value) {
  response.headers.erase(name);
  response.set_header(name, value);
}

std::string ReadAll(StoredFile& file) {
  std::string bytes;
  while (bytes.size() < file.size()) {
    bytes += file.Read(bytes.size(), static_cast<std::size_t>(file.size()) - bytes.size());
  }
  return bytes;
}

}  // namespace

Range ParseRange(std::string_view header, std::uint64_t size) {
  constexpr std::string_view kUnit = "bytes=";
  if (!header.starts_with(kUnit) || header.find(',') != std::string_view::npos) {
    return {};
  }
  header.remove_prefix(kUnit.size());
  const std::size_t dash = header.find('-');
  if (dash == std::string_view::npos) {
    return {};
  }
  const std::optional<std::uint64_t> first = Number(Trimmed(header.substr(0, dash)));
  const std::string_view rest = Trimmed(header.substr(dash + 1));
  const std::optional<std::uint64_t> last = Number(rest);
  if ((!last && !rest.empty()) || (!first && (!last || !Trimmed(header.substr(0, dash)).empty())) ||
      (first && last && *last < *first)) {
    return {};  // no range at all
  }
  if (!first) {
    const std::uint64_t length = std::min(*last, size);
    return {length == 0 ? Range::Kind::kNone : Range::Kind::kPart, size - length, length};
  }
  if (*first >= size) {
    return {Range::Kind::kNone, 0, 0};
  }
  return {Range::Kind::kPart, *first, std::min(last.value_or(size - 1), size - 1) - *first + 1};
}

bool HasTag(std::string_view list, std::string_view tag) {
  while (!list.empty()) {
    std::string_view one = NextOf(list);
    if (one.starts_with("W/")) {
      one.remove_prefix(2);
    }
    if (one == "*" || one == tag) {
      return true;
    }
  }
  return false;
}

bool TakesGzip(std::string_view accept_encoding) {
  while (!accept_encoding.empty()) {
    const std::string_view one = NextOf(accept_encoding);
    const std::size_t semicolon = std::min(one.find(';'), one.size());
    const std::string_view coding = Trimmed(one.substr(0, semicolon));
    const std::string_view quality = Trimmed(one.substr(std::min(semicolon + 1, one.size())));
    if (coding == "gzip") {
      return quality.find_first_not_of("q=0. ") != std::string_view::npos || quality.empty();
    }
  }
  return false;
}

std::string Gzip(std::string_view bytes) {
  constexpr int kGzipWindow = 15 + 16;
  z_stream stream{};
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, kGzipWindow, 8, Z_DEFAULT_STRATEGY) != Z_OK) {
    throw std::runtime_error("deflateInit2");
  }
  std::string packed(deflateBound(&stream, static_cast<uLong>(bytes.size())), '\0');
  std::string input(bytes);
  stream.next_in = reinterpret_cast<Bytef*>(input.data());
  stream.avail_in = static_cast<uInt>(input.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  const int result = deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  if (result != Z_STREAM_END) {
    throw std::runtime_error("deflate");
  }
  return packed;
}

bool SendResult(const httplib::Request& request, httplib::Response& response, const Result& result) {
  const std::shared_ptr<StoredFile>& file = result.file;
  if (file == nullptr) {
    return false;
  }
  const std::uint64_t size = file->size();
  const bool gzip = result.compresses && TakesGzip(Header(request, "Accept-Encoding"));
  const std::string tag = "\"" + result.tag + (gzip ? ".gzip" : "") + "\"";
  response.set_header("ETag", tag);
  Replace(response, "Cache-Control", "private, no-cache");
  if (result.compresses) {
    response.set_header("Vary", "Accept-Encoding");
  }
  if (HasTag(Header(request, "If-None-Match"), tag)) {
    response.status = 304;
    return true;
  }
  response.set_header("Content-Disposition", std::string("attachment; filename=\"") + result.name + "\"");
  response.status = 200;
  if (gzip) {
    response.set_header("Content-Encoding", "gzip");
    response.set_content(Gzip(ReadAll(*file)), result.type);
    return true;
  }
  response.set_header("Accept-Ranges", "bytes");
  const std::string condition = Header(request, "If-Range");
  const bool ranged = request.method == "GET" && (condition.empty() || condition == tag);
  Range range = ParseRange(ranged ? Header(request, "Range") : "", size);
  if (range.kind == Range::Kind::kNone) {
    response.set_header("Content-Range", "bytes */" + std::to_string(size));
    response.headers.erase("Content-Disposition");
    throw ProblemError(HttpProblem(
        416, "the result has " + std::to_string(size) + " bytes, and the range asks for none of them"));
  }
  if (range.kind == Range::Kind::kWhole) {
    range.length = size;
  } else {
    response.status = 206;
    response.set_header("Content-Range", "bytes " + std::to_string(range.offset) + "-" +
                                             std::to_string(range.offset + range.length - 1) + "/" +
                                             std::to_string(size));
  }
  response.set_content_provider(
      range.length, result.type,
      [file, begin = range.offset](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
        try {
          const std::string bytes = file->Read(begin + offset, std::min(length, kPieceSize));
          return sink.write(bytes.data(), bytes.size());
        } catch (const QueueError&) {
          return false;  // the answer breaks off
        }
      });
  return true;
}

}  // namespace radbake::server
