// The service's description of itself; tests/openapi judges every answer of all tests by it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>

#include "solver/parameters.h"
#include "tests/server/http_test.h"

namespace radbake::server {
namespace {

class OpenApiTest : public HttpTest {};

TEST_F(OpenApiTest, DescribesEveryParameterAsItsTableDoes) {
  const nlohmann::json document = client().Get("/openapi.json").Json();
  EXPECT_EQ(document.at("openapi"), "3.1.0");
  EXPECT_EQ(document.at("info").at("version"), RADBAKE_VERSION);
  for (const ParameterSpec& spec : ParameterSpecs()) {
    std::string pointer = "/components/schemas/Parameters/properties/" + std::string(spec.key);
    if (const std::size_t dot = pointer.find('.'); dot != std::string::npos) {
      pointer.replace(dot, 1, "/properties/");
    }
    const nlohmann::json& schema = document.at(nlohmann::json::json_pointer(pointer));
    EXPECT_THAT(schema.at("description").get<std::string>(), testing::HasSubstr(std::string(spec.takes)));
    EXPECT_EQ(schema.value("default", nlohmann::json()), spec.write(Parameters())) << spec.key;
  }
}

// Every operation is asked once, so that each is judged.
TEST_F(OpenApiTest, DescribesEveryOperation) {
  WriteFile(Go(), "");
  const std::string job = client().PostScene();
  client().WaitFor(job, "succeeded");
  const nlohmann::json paths = client().Get("/openapi.json").Json().at("paths");
  for (const auto& [path, item] : paths.items()) {
    std::string target = path;
    if (const std::size_t id = target.find("/v1/bakes/{id}"); id == 0) {
      target.replace(0, std::string("/v1/bakes/{id}").size(), job);
    }
    if (const std::size_t module = target.find("{module}"); module != std::string::npos) {
      target.replace(module, std::string::npos, "build/three.module.js");
    }
    for (const char* method : {"get", "head", "options"}) {
      std::string upper = method;
      std::transform(upper.begin(), upper.end(), upper.begin(),
                     [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
      const Answer answer = client().Request(upper, target);
      EXPECT_EQ(answer.status == 405, !item.contains(method) || upper == "OPTIONS") << upper << " " << target;
    }
  }
  EXPECT_EQ(client().Request("POST", job + "/cancel").status, 409);
  EXPECT_EQ(client().Request("DELETE", job).status, 204);
}

}  // namespace
}  // namespace radbake::server
