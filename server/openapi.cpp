#include "server/openapi.h"

#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "openapi.json.h"
#include "solver/parameters.h"

namespace radbake::server {
namespace {

using Json = nlohmann::ordered_json;

// "output.kind" is {"output": {"kind": …}}.
Json& SchemaOf(std::string_view key, Json& schema) {
  const std::size_t dot = key.find('.');
  Json& member = schema["properties"][std::string(key.substr(0, dot))];
  if (dot == std::string_view::npos) {
    return member;
  }
  member["type"] = "object";
  member["additionalProperties"] = false;
  return SchemaOf(key.substr(dot + 1), member);
}

}  // namespace

std::string OpenApi() {
  Json document = Json::parse(kOpenApi);
  document["info"]["version"] = RADBAKE_VERSION;
  Json& parameters = document["components"]["schemas"]["Parameters"];
  for (const ParameterSpec& spec : ParameterSpecs()) {
    Json& schema = SchemaOf(spec.key, parameters);
    schema["description"] = std::string(spec.means) + "; takes " + std::string(spec.takes);
    if (Json value = spec.write(Parameters()); !value.is_null()) {
      schema["default"] = std::move(value);
    }
  }
  return document.dump();
}

}  // namespace radbake::server
