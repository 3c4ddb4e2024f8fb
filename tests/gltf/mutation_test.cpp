// Real scenes with random damage: each is taken or refused with an InputError, and nothing else happens. The
// sanitizers' builds are what gives this test its teeth.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <random>

#include "tests/gltf/builder_test.h"

namespace radbake::gltf {
namespace {

std::size_t Below(std::mt19937_64& random, std::size_t end) {
  return random() % end;
}

/// Damages a .glb: single bytes, digits of its JSON, stretches that are cut out, moved or overwritten.
std::string Damage(std::string glb, std::size_t json_end, std::mt19937_64& random) {
  const std::size_t times = 1 + Below(random, 4);
  for (std::size_t i = 0; i < times && glb.size() > 64; ++i) {
    const std::size_t at = Below(random, random() % 4 == 0 ? glb.size() : std::min(json_end, glb.size()));
    switch (Below(random, 6)) {
      case 0:
        glb[at] = static_cast<char>(random());
        break;
      case 1:
      case 2:
      case 3: {  // another number in the JSON: an index, a count, an offset
        const std::size_t digit = glb.find_first_of("0123456789", at);
        if (digit != std::string::npos) {
          glb[digit] = static_cast<char>('0' + Below(random, 10));
        }
        break;
      }
      case 4:
        glb.resize(at + 1);
        break;
      default: {
        const std::size_t length = std::min<std::size_t>(1 + Below(random, 16), glb.size() - at);
        const std::size_t from = Below(random, glb.size() - length);
        glb.replace(at, length, glb.substr(from, length));
      }
    }
  }
  return glb;
}

TEST(Mutation, DamageIsTakenOrRefusedAndNothingElse) {
  constexpr std::size_t kIterations = 2000;
  std::mt19937_64 random(1);
  std::size_t taken = 0;
  std::size_t refused = 0;
  // The room of spheres is left out: the other two have all that it has, in far fewer bytes.
  for (const char* name : {"cornell-box-bevy", "living-room"}) {
    const std::string glb =
        ReadSource(RADBAKE_SOURCE_DIR "/../shared/scenes/" + std::string(name) + ".glb").bytes;
    const std::size_t json_end = 20 + Unpacked(glb).root.dump().size();
    for (std::size_t i = 0; i < kIterations / 2; ++i) {
      const Source source{Damage(glb, json_end, random), {}};
      try {
        const Document document(source);
        const std::string baked = document.Export(TrivialBake(document.scene()));
        EXPECT_GT(ReadIrradiance(Source{baked, {}}).triangles.size(), 0U);
        ++taken;
      } catch (const InputError& error) {
        EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
        ++refused;
      }
    }
  }
  EXPECT_GT(taken, 100U) << "damage that is always refused at the door tests little";
  EXPECT_GT(refused, 100U);
}

}  // namespace
}  // namespace radbake::gltf
