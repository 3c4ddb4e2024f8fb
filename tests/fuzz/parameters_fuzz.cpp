// The parameters of a bake: what is taken is written out and taken again, as the same.
#include <nlohmann/json.hpp>

#include "solver/parameters.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radbake;
  try {
    const Parameters parameters = ParseParameters(fuzz::Text(data, size));
    const std::string written = ToJson(parameters).dump();
    fuzz::Demand(ToJson(ParseParameters(written)).dump() == written, "parameters are taken back");
  } catch (const InputError& error) {
    const std::string message = error.what();
    fuzz::Demand(!message.empty() && message.find('\n') == std::string::npos, "an error is one line");
  }
  return 0;
}
