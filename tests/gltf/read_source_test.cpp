#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "tests/gltf/builder_test.h"

namespace radbake::gltf {
namespace {

namespace fs = std::filesystem;

/// A folder of its own, gone at the end.
class ReadSourceTest : public testing::Test {
 public:
  ReadSourceTest(const ReadSourceTest&) = delete;
  ReadSourceTest& operator=(const ReadSourceTest&) = delete;

 protected:
  ReadSourceTest() {
    std::string name = (fs::temp_directory_path() / "radbake-gltf-XXXXXX").string();
    outer_ = mkdtemp(name.data());
    folder_ = outer_ / "scene";
    fs::create_directories(folder_ / "parts");
  }
  ~ReadSourceTest() override { fs::remove_all(outer_); }

  static void Write(const fs::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
  }
  std::string WriteScene(const std::string& uri) {
    Json root = OneTriangle().Root();
    root["buffers"][0]["uri"] = uri;
    Write(folder_ / "scene.gltf", root.dump());
    return (folder_ / "scene.gltf").string();
  }
  void ExpectRefused(const std::string& uri, const std::string& message) {
    try {
      ReadSource(WriteScene(uri));
      ADD_FAILURE() << uri << " was read";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(message));
    }
  }

  fs::path outer_;
  fs::path folder_;
};

TEST_F(ReadSourceTest, ReadsAGlb) {
  Write(folder_ / "scene.glb", OneTriangle().Glb());
  EXPECT_EQ(Document(ReadSource((folder_ / "scene.glb").string())).scene().surfaces.size(), 1U);
}

TEST_F(ReadSourceTest, ReadsPartsBelowTheScene) {
  Write(folder_ / "parts" / "my mesh.bin", OneTriangle().binary);
  const Source source = ReadSource(WriteScene("parts/my%20mesh.bin"));
  EXPECT_THAT(source.resources,
              testing::ElementsAre(testing::Pair("parts/my%20mesh.bin", OneTriangle().binary)));
  EXPECT_EQ(Document(source).scene().surfaces.size(), 1U);
}

TEST_F(ReadSourceTest, FindsPartsFromAnotherWorkingFolder) {
  Write(folder_ / "mesh.bin", OneTriangle().binary);
  WriteScene("mesh.bin");
  const fs::path relative = fs::relative(folder_ / "scene.gltf");
  EXPECT_EQ(ReadSource(relative.string()).resources.size(), 1U);
}

TEST_F(ReadSourceTest, RefusesWhatIsNotThere) {
  EXPECT_THROW(ReadSource((folder_ / "none.glb").string()), InputError);
  EXPECT_THROW(ReadSource(folder_.string()), InputError);
  ExpectRefused("none.bin", "buffer 0: there is no file 'none.bin' beside the scene");
  ExpectRefused("parts", "buffer 0: there is no file 'parts' beside the scene");
}

TEST_F(ReadSourceTest, ReadsNothingOutsideTheScenesFolder) {
  Write(outer_ / "secret.bin", OneTriangle().binary);
  fs::create_symlink(outer_ / "secret.bin", folder_ / "link.bin");
  fs::create_directory_symlink(outer_, folder_ / "up");
  ExpectRefused("../secret.bin", "leaves the upload");
  ExpectRefused((outer_ / "secret.bin").string(), "leaves the upload");
  ExpectRefused("%2e%2e/secret.bin", "leaves the upload");
  ExpectRefused("link.bin", "leaves the scene's folder");
  ExpectRefused("up/secret.bin", "leaves the scene's folder");
}

}  // namespace
}  // namespace radbake::gltf
