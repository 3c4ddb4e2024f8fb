// The include directions of the architecture, the layout of the top level, and that no file knows the machine
// it was written on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

const fs::path kRoot = RADBAKE_SOURCE_DIR;

std::string Read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// All files below the given folders, as paths from the root.
std::vector<std::string> Files(const std::vector<std::string>& folders) {
  std::vector<std::string> files;
  for (const std::string& folder : folders) {
    for (fs::recursive_directory_iterator it(kRoot / folder), end; it != end; ++it) {
      if (it->path().filename() == "node_modules") {
        it.disable_recursion_pending();
      } else if (it->is_regular_file()) {
        files.push_back(fs::relative(it->path(), kRoot).generic_string());
      }
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<std::string> Sources(const std::vector<std::string>& folders) {
  std::vector<std::string> files = Files(folders);
  std::erase_if(files,
                [](const std::string& file) { return !file.ends_with(".cpp") && !file.ends_with(".h"); });
  return files;
}

std::vector<std::string> Includes(const std::string& text) {
  std::vector<std::string> includes;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t begin = line.find_first_of("<\"");
    const std::size_t end = line.find_last_of(">\"");
    if (line.starts_with("#include") && begin < end && end != std::string::npos) {
      includes.push_back(line.substr(begin + 1, end - begin - 1));
    }
  }
  return includes;
}

bool StartsWithAny(const std::string& text, const std::vector<std::string>& prefixes) {
  return std::any_of(prefixes.begin(), prefixes.end(),
                     [&](const auto& prefix) { return text.starts_with(prefix); });
}

/// The folder of solver/ that a file lies in; empty for what stands on top of the steps.
std::string Step(const std::string& file) {
  const std::size_t begin = std::string("solver/").size();
  const std::size_t end = file.find('/', begin);
  return end == std::string::npos ? "" : file.substr(begin, end - begin);
}

/// May a file of solver/ include another one of solver/? A later step knows the earlier ones, never the other
/// way round; the two ends (gltf/) and the judge (check/) know the data they are handed, and no more.
bool MayKnow(const std::string& file, const std::string& included) {
  static const std::vector<std::string> kFlow = {"scene",  "hierarchy", "transport",
                                                 "refine", "solve",     "bake"};
  const std::string from = Step(file);
  const std::string to = Step(included);
  if (from == to) {
    return true;
  }
  if (from == "gltf") {
    return to == "scene" || included == "solver/bake/baked_scene.h";
  }
  if (from == "check") {
    return to == "scene" || included == "solver/bake/baked_scene.h" ||
           included == "solver/transport/ray_caster.h";
  }
  if (from == "cli") {
    return true;
  }
  if (from.empty()) {
    return to != "cli" && (to != "gltf" || file == "solver/radbake.h" || file == "solver/radbake.cpp");
  }
  const auto later = std::find(kFlow.begin(), kFlow.end(), from);
  return later != kFlow.end() && std::find(kFlow.begin(), later, to) != later;
}

/// A library's headers, and the only files that may include them.
struct Wrapped {
  std::vector<std::string> headers;
  std::vector<std::string> files;
};
const std::map<std::string, Wrapped> kWrapped = {
    {"embree", {{"embree3/", "embree4/"}, {"solver/transport/ray_caster.cpp"}}},
    {"tinygltf", {{"tiny_gltf", "tinygltf"}, {"solver/gltf/"}}},
    {"httplib", {{"httplib.h"}, {"server/http", "server/upload", "server/problem"}}},
    {"sqlite", {{"sqlite3"}, {"server/queue"}}},
    {"libpq", {{"libpq", "postgresql/"}, {"server/queue"}}},
};

bool MayInclude(const std::string& file, const std::string& include) {
  for (const auto& [library, wrapped] : kWrapped) {
    if (StartsWithAny(include, wrapped.headers)) {
      return StartsWithAny(file, wrapped.files);
    }
  }
  if (include.starts_with("tests/")) {
    return false;
  }
  if (file.starts_with("server/")) {
    return true;
  }
  if (include.starts_with("server/")) {
    return false;
  }
  return !include.starts_with("solver/") || MayKnow(file, include);
}

TEST(Architecture, TheRulesTellGoodIncludesFromBadOnes) {
  EXPECT_TRUE(MayInclude("solver/solve/solver.cpp", "solver/transport/link.h"));
  EXPECT_TRUE(MayInclude("solver/gltf/export.cpp", "solver/bake/baked_scene.h"));
  EXPECT_TRUE(MayInclude("solver/gltf/import.cpp", "tiny_gltf.h"));
  EXPECT_TRUE(MayInclude("solver/check/probes.cpp", "solver/transport/ray_caster.h"));
  EXPECT_TRUE(MayInclude("solver/statistics.h", "solver/solve/solution.h"));
  EXPECT_TRUE(MayInclude("server/http.cpp", "httplib.h"));
  EXPECT_FALSE(MayInclude("solver/transport/link.h", "solver/solve/solver.h"));
  EXPECT_FALSE(MayInclude("solver/bake/vertices.cpp", "solver/gltf/document.h"));
  EXPECT_FALSE(MayInclude("solver/solve/solver.cpp", "solver/parameters.h"));
  EXPECT_FALSE(MayInclude("solver/statistics.cpp", "solver/gltf/document.h"));
  EXPECT_FALSE(MayInclude("solver/gltf/export.cpp", "solver/bake/vertices.h"));
  EXPECT_FALSE(MayInclude("solver/check/probes.cpp", "solver/transport/form_factor.h"));
  EXPECT_FALSE(MayInclude("solver/solve/solver.cpp", "solver/check/check.h"));
  EXPECT_FALSE(MayInclude("solver/scene/scene.cpp", "server/queue.h"));
  EXPECT_FALSE(MayInclude("solver/check/probes.cpp", "embree4/rtcore.h"));
  EXPECT_FALSE(MayInclude("server/worker.cpp", "sqlite3.h"));
  EXPECT_FALSE(MayInclude("solver/newcomer/file.cpp", "solver/scene/scene.h"));
}

TEST(Architecture, EveryIncludeFollowsTheDirectionsOfTheDesign) {
  std::vector<std::string> violations;
  std::set<std::string> wrapped_and_used;
  for (const std::string& file : Sources({"solver", "server"})) {
    for (const std::string& include : Includes(Read(kRoot / file))) {
      if (!MayInclude(file, include)) {
        violations.push_back(file + " includes " + include);
      }
      for (const auto& [library, wrapped] : kWrapped) {
        if (StartsWithAny(include, wrapped.headers)) {
          wrapped_and_used.insert(library);
        }
      }
    }
  }
  EXPECT_THAT(violations, IsEmpty());
  EXPECT_THAT(wrapped_and_used, testing::IsSupersetOf({"embree", "httplib", "sqlite", "libpq"}));
}

TEST(Architecture, OwnFilesAreIncludedByTheirPathFromTheRoot) {
  std::vector<std::string> violations;
  for (const std::string& file : Sources({"solver", "server", "tests"})) {
    for (const std::string& include : Includes(Read(kRoot / file))) {
      const bool own = fs::exists((kRoot / file).parent_path() / include);
      if (include.starts_with(".") || (own && !fs::exists(kRoot / include))) {
        violations.push_back(file + " includes " + include);
      }
    }
  }
  EXPECT_THAT(violations, IsEmpty());
}

TEST(Architecture, TheTopLevelHoldsExactlyTheLayout) {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(kRoot)) {
    const std::string name = entry.path().filename();
    if (!name.starts_with(".") && name != "build") {
      names.push_back(name);
    }
  }
  EXPECT_THAT(names, UnorderedElementsAre("CMakeLists.txt", "CMakePresets.json", "LICENSE", "README.md",
                                          "deploy", "scenes", "server", "solver", "tests"));
}

/// The first folder of a person or a workplace, or place of a package, that the text names; empty if none.
std::string MachineNamedIn(const std::string& text) {
  static const std::vector<std::string> kFolders = {"home", "root", "Users", "work", "workspace", "mnt"};
  for (const std::string& folder : kFolders) {
    const std::string path = "/" + folder + "/";
    for (std::size_t at = text.find(path); at != std::string::npos; at = text.find(path, at + 1)) {
      const bool whole = at == 0 || std::string(" \t\n\"'=:(<[`").find(text[at - 1]) != std::string::npos;
      if (whole) {
        return text.substr(at, 40);
      }
    }
  }
  for (const char* mark : {"\"resolved\":", "//registry."}) {
    if (text.find(mark) != std::string::npos) {
      return mark;
    }
  }
  return "";
}

TEST(Architecture, NoFileKnowsTheMachineItWasWrittenOn) {
  ASSERT_NE(MachineNamedIn("-I/ho" + std::string("me/me \"/ho") + "me/me/scene.h\""), "");
  ASSERT_EQ(MachineNamedIn("tests/home/scene.h https://example.org/work/"), "");
  std::vector<std::string> files = Files({"deploy", "scenes", "server", "solver", "tests", ".ci"});
  for (const char* file : {"CMakeLists.txt", "CMakePresets.json", "README.md"}) {
    files.emplace_back(file);
  }
  std::vector<std::string> violations;
  for (const std::string& file : files) {
    if (file.ends_with(".glb") || file.ends_with(".png") || file == "tests/architecture_test.cpp") {
      continue;
    }
    if (const std::string found = MachineNamedIn(Read(kRoot / file)); !found.empty()) {
      violations.push_back(file);
      violations.back() += ": " + found;
    }
  }
  EXPECT_THAT(violations, IsEmpty());
}

}  // namespace
