// The head of a request, and the headers that are read here and not by the library: ranges, tags, encodings,
// origins.
#include <algorithm>
#include <cctype>
#include <optional>
#include <string>

#include "server/http.h"
#include "server/http_connection.h"
#include "server/http_result.h"
#include "tests/fuzz/fuzz.h"

namespace {

using namespace radbake;

void CheckRange(std::string_view header, std::uint64_t size) {
  const server::Range range = server::ParseRange(header, size);
  if (range.kind == server::Range::Kind::kPart) {
    fuzz::Demand(range.length > 0 && range.offset < size && range.length <= size - range.offset,
                 "a range lies within what there is");
  }
}

void CheckHead(std::string_view bytes) {
  server::HttpLimits limits;
  limits.headers = 16;
  try {
    const std::optional<std::size_t> end = server::HeadEnd(bytes, limits);
    if (!end) {
      return;
    }
    fuzz::Demand(*end <= bytes.size() && bytes.substr(*end - 4, 4) == "\r\n\r\n",
                 "a head ends with an empty line");
    const std::string head = server::Identified(server::Harmless(bytes.substr(0, *end)));
    fuzz::Demand(head.find("\r\n\r\n") == head.size() - 4, "a harmless head is one head");
    std::string lower = head;
    std::transform(lower.begin(), lower.end(), lower.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    for (const char* name : {"range", "content-type", "content-encoding", "accept-encoding", "remote_addr",
                             "remote_port", "local_addr", "local_port", "radbaked-held-status"}) {
      fuzz::Demand(lower.find("\r\n" + std::string(name) + ":") == std::string::npos,
                   "the library acts on no such header");
    }
    fuzz::Demand(lower.find("\r\nx-request-id:") != std::string::npos, "a request has an id");
    fuzz::Demand(std::none_of(lower.begin(), lower.end(),
                              [](char c) {
                                return static_cast<unsigned char>(c) < 0x20 && c != '\r' && c != '\n' &&
                                       c != '\t';
                              }),
                 "no control character passes");
    fuzz::Demand(server::Harmless(head).size() <= head.size(), "what is harmless stays so");
  } catch (const server::ProblemError& error) {
    fuzz::Demand(error.problem().status == 400 || error.problem().status == 431,
                 "a bad head is a 400 or a 431");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = fuzz::Text(data, size);
  for (const std::uint64_t length : {std::uint64_t{1}, std::uint64_t{10}, ~std::uint64_t{0}}) {
    CheckRange(text, length);
  }
  server::HasTag(text, "\"tag\"");
  server::TakesGzip(text);
  server::IsOrigin(text);
  CheckHead(text);
  return 0;
}
