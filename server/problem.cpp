#include "server/problem.h"

#include <array>
#include <nlohmann/json.hpp>
#include <utility>

namespace radbake::server {
namespace {

constexpr std::array<std::pair<int, const char*>, 14> kPhrases = {{{400, "Bad Request"},
                                                                   {401, "Unauthorized"},
                                                                   {403, "Forbidden"},
                                                                   {404, "Not Found"},
                                                                   {405, "Method Not Allowed"},
                                                                   {408, "Request Timeout"},
                                                                   {411, "Length Required"},
                                                                   {413, "Content Too Large"},
                                                                   {414, "URI Too Long"},
                                                                   {415, "Unsupported Media Type"},
                                                                   {416, "Range Not Satisfiable"},
                                                                   {429, "Too Many Requests"},
                                                                   {431, "Request Header Fields Too Large"},
                                                                   {503, "Service Unavailable"}}};

std::string Phrase(int status) {
  for (const auto& [known, phrase] : kPhrases) {
    if (known == status) {
      return phrase;
    }
  }
  return status < 500 ? "Bad Request" : "Internal Server Error";
}

Problem Kind(int status, const std::string& name, std::string title, std::string detail) {
  return {status, "urn:radbake:problem:" + name, std::move(title),
          detail.empty() ? "no reason was given" : std::move(detail), std::chrono::seconds(1)};
}

}  // namespace

Problem HttpProblem(int status, std::string detail) {
  return {status, "about:blank", Phrase(status), std::move(detail), std::chrono::seconds(1)};
}

Problem BadParameters(std::string detail) {
  return Kind(422, "parameters", "The parameters cannot be used", std::move(detail));
}

Problem BadScene(std::string detail) {
  return Kind(422, "scene", "The scene cannot be baked", std::move(detail));
}

Problem BadUpload(std::string detail) {
  return Kind(422, "upload", "The parts of the upload do not fit", std::move(detail));
}

Problem TooLarge(std::string detail) {
  return Kind(413, "too-large", "The upload is too large", std::move(detail));
}

Problem KeyReused(std::string detail) {
  return Kind(422, "key-reused", "The idempotency key has come with another payload", std::move(detail));
}

Problem NoResult(std::string detail) {
  return Kind(409, "no-result", "The job has no result", std::move(detail));
}

Problem AlreadyEnded(std::string detail) {
  return Kind(409, "ended", "The job has ended", std::move(detail));
}

Problem BeyondLimit(std::string detail) {
  return Kind(422, "limit", "The bake takes more than it may", std::move(detail));
}

Problem BakeFailed(std::string detail) {
  return Kind(500, "bake-failed", "The bake failed", std::move(detail));
}

std::string ToText(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

nlohmann::json ToJson(const Problem& problem) {
  nlohmann::json json = {{"type", problem.type},
                         {"title", problem.title},
                         {"status", problem.status},
                         {"detail", problem.detail}};
  if (!problem.log.empty()) {
    json["log"] = problem.log;
  }
  return json;
}

Problem ProblemFromJson(const nlohmann::json& json) {
  return {json.at("status").get<int>(),
          json.at("type").get<std::string>(),
          json.at("title").get<std::string>(),
          json.at("detail").get<std::string>(),
          std::chrono::seconds(1),
          json.value("log", "")};
}

std::string Quoted(std::string_view text) {
  constexpr std::size_t kLongest = 120;
  std::string quoted = "\"";
  for (const char c : text.substr(0, kLongest)) {
    const bool control = static_cast<unsigned char>(c) < 0x20 || c == 0x7F;
    quoted += control ? '?' : c;
  }
  quoted += text.size() > kLongest ? "…\"" : "\"";
  return quoted;
}

}  // namespace radbake::server
