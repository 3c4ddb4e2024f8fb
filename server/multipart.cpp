#include "server/multipart.h"

#include <strings.h>

#include <algorithm>
#include <map>
#include <utility>

#include "server/problem.h"
#include "server/text.h"

namespace radbake::server {
namespace {

constexpr std::size_t kLongestHeader = 8192;
constexpr std::size_t kLongestBoundary = 70;  // RFC 2046
constexpr std::string_view kSpaces = " \t";

[[noreturn]] void Refuse(const std::string& what) {
  throw ProblemError(HttpProblem(400, "the body is not multipart/form-data: " + what));
}

struct HeaderValue {
  std::string value;                              // lower case
  std::map<std::string, std::string> parameters;  // names in lower case; the first of each name
};

// `value; name=token; name="quoted \" string"`
HeaderValue ParseValue(std::string_view text) {
  HeaderValue header;
  const std::size_t first = std::min(text.find(';'), text.size());
  header.value = Lower(Trimmed(text.substr(0, first)));
  text.remove_prefix(first);
  while (!text.empty()) {
    text.remove_prefix(1);  // the semicolon
    const std::size_t equals = text.find_first_of("=;");
    if (equals == std::string_view::npos || text[equals] == ';') {
      text.remove_prefix(std::min(equals, text.size()));
      continue;
    }
    const std::string name = Lower(Trimmed(text.substr(0, equals)));
    text.remove_prefix(equals + 1);
    text.remove_prefix(std::min(text.find_first_not_of(kSpaces), text.size()));
    std::string value;
    if (text.starts_with('"')) {
      std::size_t i = 1;
      for (; i < text.size() && text[i] != '"'; ++i) {
        const bool escapes =
            text[i] == '\\' && i + 1 < text.size() && (text[i + 1] == '"' || text[i + 1] == '\\');
        i += escapes ? 1 : 0;
        value += text[i];
      }
      text.remove_prefix(std::min(i + 1, text.size()));
    } else {
      value = Trimmed(text.substr(0, text.find(';')));
    }
    text.remove_prefix(std::min(text.find(';'), text.size()));
    header.parameters.emplace(name, value);
  }
  return header;
}

std::string Parameter(const HeaderValue& header, const std::string& name) {
  const auto found = header.parameters.find(name);
  return found == header.parameters.end() ? "" : found->second;
}

MultipartParser::Part ParsePart(std::string_view header) {
  while (!header.empty()) {
    const std::string_view line = header.substr(0, header.find("\r\n"));
    header.remove_prefix(std::min(line.size() + 2, header.size()));
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos || Lower(Trimmed(line.substr(0, colon))) != "content-disposition") {
      continue;
    }
    const HeaderValue disposition = ParseValue(line.substr(colon + 1));
    MultipartParser::Part part{Parameter(disposition, "name"), Parameter(disposition, "filename")};
    if (disposition.value == "form-data" && !part.name.empty()) {
      return part;
    }
  }
  Refuse("a part has no name");
}

}  // namespace

std::string MultipartBoundary(std::string_view content_type) {
  const HeaderValue header = ParseValue(content_type);
  std::string boundary = Parameter(header, "boundary");
  const bool fits = header.value == "multipart/form-data" && boundary.size() <= kLongestBoundary;
  return fits ? boundary : "";
}

// The line break before a boundary belongs to it; the first boundary may do without.
MultipartParser::MultipartParser(const std::string& boundary, Events events)
    : delimiter_("\r\n--" + boundary), events_(std::move(events)), buffer_("\r\n") {}

void MultipartParser::Feed(std::string_view bytes) {
  buffer_ += bytes;
  while (Step()) {
  }
}

void MultipartParser::End() {
  if (state_ != State::kEpilogue) {
    Refuse("it ends before its last boundary");
  }
}

// False when more bytes are needed.
bool MultipartParser::Step() {
  switch (state_) {
    case State::kPreamble:
    case State::kBody:
      return ReadUntilDelimiter();
    case State::kDelimiter:
      return ReadDelimiterEnd();
    case State::kHeader:
      return ReadHeader();
    case State::kEpilogue:
      buffer_.clear();
      return false;
  }
  return false;
}

bool MultipartParser::ReadUntilDelimiter() {
  const std::size_t found = buffer_.find(delimiter_);
  const bool whole = found != std::string::npos;
  const std::size_t keep = delimiter_.size() - 1;
  const std::size_t length = whole ? found : buffer_.size() - std::min(keep, buffer_.size());
  if (state_ == State::kBody && length > 0) {
    events_.data(std::string_view(buffer_).substr(0, length));
  }
  buffer_.erase(0, whole ? length + delimiter_.size() : length);
  if (whole) {
    if (state_ == State::kBody) {
      events_.end();
    }
    state_ = State::kDelimiter;
  }
  return whole;
}

bool MultipartParser::ReadDelimiterEnd() {
  const std::size_t text = std::min(buffer_.find_first_not_of(kSpaces), buffer_.size());
  if (buffer_.size() < text + 2) {
    if (buffer_.size() > kLongestHeader) {
      Refuse("a boundary's line is too long");
    }
    return false;
  }
  if (text == 0 && buffer_.starts_with("--")) {
    state_ = State::kEpilogue;
    return true;
  }
  if (buffer_.compare(text, 2, "\r\n") != 0) {
    Refuse("a boundary is followed by something else");
  }
  buffer_.erase(0, text);  // the line break stays: a part may have no header, and then ends as one that has
  state_ = State::kHeader;
  return true;
}

bool MultipartParser::ReadHeader() {
  const std::size_t end = buffer_.find("\r\n\r\n");
  if (std::min(end, buffer_.size()) > kLongestHeader) {
    Refuse("the header of a part is too long");
  }
  if (end == std::string::npos) {
    return false;
  }
  const Part part = ParsePart(std::string_view(buffer_).substr(0, end));
  buffer_.erase(0, end + 4);
  state_ = State::kBody;
  events_.begin(part);
  return true;
}

}  // namespace radbake::server
