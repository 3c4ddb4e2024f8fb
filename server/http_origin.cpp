#include "server/http_origin.h"

#include <algorithm>
#include <cctype>

#include "server/http.h"
#include "server/http_request.h"

namespace radbake::server {

bool IsOrigin(std::string_view text) {
  const std::size_t host = text.starts_with("https://") ? 8 : text.starts_with("http://") ? 7 : text.size();
  text.remove_prefix(host);
  return !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::islower(c) != 0 || std::isdigit(c) != 0 ||
           std::string_view(".-:[]").find(static_cast<char>(c)) != std::string_view::npos;
  });
}

bool Origins::IsPreflight(const httplib::Request& request) const {
  return request.method == "OPTIONS" && request.has_header("Access-Control-Request-Method") &&
         allowed_.contains(request.get_header_value("Origin")) &&
         ParsePath(request.path).resource != Resource::kNone;
}

void Origins::AnswerPreflight(const httplib::Request& request, httplib::Response& response) const {
  response.status = 204;
  response.set_header("Access-Control-Allow-Methods", std::string(Allowed(ParsePath(request.path).resource)));
  response.set_header(
      "Access-Control-Allow-Headers",
      "Authorization, Content-Type, Idempotency-Key, If-None-Match, If-Range, Last-Event-ID, Prefer, "
      "Range, X-Request-Id");
  response.set_header("Access-Control-Max-Age", "600");
}

void Origins::Allow(const httplib::Request& request, httplib::Response& response) const {
  if (allowed_.empty()) {
    return;
  }
  response.set_header("Vary", "Origin");
  const std::string origin = request.get_header_value("Origin");
  if (allowed_.contains(origin)) {
    response.set_header("Access-Control-Allow-Origin", origin);
    response.set_header(
        "Access-Control-Expose-Headers",
        "Content-Disposition, Content-Range, ETag, Location, Preference-Applied, Retry-After, "
        "WWW-Authenticate, X-Request-Id");
  }
}

}  // namespace radbake::server
