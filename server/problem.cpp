#include "server/problem.h"

#include <nlohmann/json.hpp>

namespace radbake::server {
namespace {

std::string Phrase(int status) {
  switch (status) {
    case 400:
      return "Bad Request";
    case 404:
      return "Not Found";
    case 405:
      return "Method Not Allowed";
    case 411:
      return "Length Required";
    case 414:
      return "URI Too Long";
    case 415:
      return "Unsupported Media Type";
    case 416:
      return "Range Not Satisfiable";
    case 503:
      return "Service Unavailable";
    default:
      return status < 500 ? "Bad Request" : "Internal Server Error";
  }
}

Problem Kind(int status, const std::string& name, std::string title, std::string detail) {
  return {status, "urn:radbake:problem:" + name, std::move(title), std::move(detail)};
}

}  // namespace

Problem HttpProblem(int status, std::string detail) {
  return {status, "about:blank", Phrase(status), std::move(detail)};
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

Problem NoResult(std::string detail) {
  return Kind(409, "no-result", "The job has no result", std::move(detail));
}

Problem AlreadyEnded(std::string detail) {
  return Kind(409, "ended", "The job has ended", std::move(detail));
}

Problem BakeFailed(std::string detail) {
  return Kind(500, "bake-failed", "The bake failed", std::move(detail));
}

std::string ToText(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

nlohmann::json ToJson(const Problem& problem) {
  return {{"type", problem.type},
          {"title", problem.title},
          {"status", problem.status},
          {"detail", problem.detail}};
}

Problem ProblemFromJson(const nlohmann::json& json) {
  return {json.at("status").get<int>(), json.at("type").get<std::string>(),
          json.at("title").get<std::string>(), json.at("detail").get<std::string>()};
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
