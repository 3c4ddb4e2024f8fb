// glTF: an input is a .glb as it is, or the JSON of one with its binary chunk behind a zero byte, so that a
// mutation need not keep the container's lengths right. What is taken is written back, and the result is read
// again.
#include "tests/fuzz/fuzz.h"
#include "tests/gltf/builder_test.h"

namespace {

std::string Glb(std::string_view input) {
  if (input.starts_with("glTF")) {
    return std::string(input);
  }
  const std::size_t end = std::min(input.find('\0'), input.size());
  return radbake::gltf::Builder::Pack(std::string(input.substr(0, end)),
                                      std::string(input.substr(std::min(end + 1, input.size()))));
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radbake;
  // A few bytes can ask for millions of triangles: that is slow, and no fault.
  const gltf::Limits limits{64, 2000, 1000, 1U << 20U};
  const gltf::Source source{Glb(fuzz::Text(data, size)), {{"beside.bin", std::string(64, '\1')}}};
  try {
    const gltf::Document document(source, limits);
    const std::string baked = document.Export(gltf::TrivialBake(document.scene()));
    fuzz::Demand(baked.starts_with("glTF"), "a baked scene is a .glb");
    gltf::ReadIrradiance(gltf::Source{baked, {}});
  } catch (const InputError& error) {
    const std::string message = error.what();
    fuzz::Demand(!message.empty() && message.find('\n') == std::string::npos, "an error is one line");
    fuzz::Demand(message.size() < 1000, "an error is short");
  }
  return 0;
}
