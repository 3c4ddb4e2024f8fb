#include "solver/gltf/document.h"
#include "tests/bench/bench.h"

namespace radbake::bench {
namespace {

bool any_failed = false;

}  // namespace

void Fail(benchmark::State& state, const std::string& why) {
  any_failed = true;
  state.SkipWithError(why.c_str());
}

bool AnyFailed() {
  return any_failed;
}

Patches LoadPatches(const std::string& scene) {
  const std::string path = RADBAKE_SOURCE_DIR "/scenes/" + scene + ".glb";
  return CutIntoPatches(gltf::Document(gltf::ReadSource(path)).scene());
}

}  // namespace radbake::bench

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) {
    return 2;
  }
  radbake::bench::RegisterBakes();
  radbake::bench::RegisterBases();
  radbake::bench::RegisterLinks();
  radbake::bench::RegisterOracles();
  radbake::bench::RegisterTransport();
  benchmark::RunSpecifiedBenchmarks();
  return radbake::bench::AnyFailed() ? 1 : 0;
}
