// The default bake of every scene, start to finish: `radbake` in a process of its own, on two threads.
#include <fcntl.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "tests/bench/bench.h"

namespace radbake::bench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int kThreads = 2;
constexpr double kLargestImbalance = 0.005;

struct Scene {
  const char* name;
  const char* path;
  double largest_error;                  ///< relative RMS, measured
  std::optional<double> most_megabytes;  ///< of the process at its peak, 10⁶ bytes
};

constexpr std::array kScenes = {Scene{.name = "cornell-box",
                                      .path = RADBAKE_SOURCE_DIR "/scenes/cornell-box.glb",
                                      .largest_error = 0.02,
                                      .most_megabytes = 200},
                                Scene{.name = "two-rooms",
                                      .path = RADBAKE_SOURCE_DIR "/scenes/two-rooms.glb",
                                      .largest_error = 0.03,
                                      .most_megabytes = {}},
                                Scene{.name = "furnace-box",
                                      .path = RADBAKE_SOURCE_DIR "/scenes/furnace-box.glb",
                                      .largest_error = 0.02,
                                      .most_megabytes = {}},
                                Scene{.name = "furnace-sphere",
                                      .path = RADBAKE_SOURCE_DIR "/scenes/furnace-sphere.glb",
                                      .largest_error = 0.02,
                                      .most_megabytes = {}},
                                Scene{.name = "plates-occluded",
                                      .path = RADBAKE_SOURCE_DIR "/scenes/plates-occluded.glb",
                                      .largest_error = 0.02,
                                      .most_megabytes = {}},
                                Scene{.name = "cornell-box-bevy",
                                      .path = RADBAKE_SOURCE_DIR "/../shared/scenes/cornell-box-bevy.glb",
                                      .largest_error = 0.02,
                                      .most_megabytes = {}}};

/// A folder that goes away with its owner.
class Folder {
 public:
  Folder() {
    path_ = (fs::temp_directory_path() / "radbake-bench-XXXXXX").string();
    if (mkdtemp(path_.data()) == nullptr) {
      throw std::system_error(errno, std::generic_category(), path_);
    }
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::string File(const char* name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

struct Run {
  bool succeeded = false;
  double seconds = 0;      ///< from before the process starts until it has ended
  double cpu_seconds = 0;  ///< of all its threads, user and system
  double peak_bytes = 0;
};

double Seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

/// `log`: the file that its standard error goes to.
Run RunProgram(std::vector<std::string> words, const std::string& log) {
  std::vector<char*> argv(words.size() + 1);
  std::ranges::transform(words, argv.begin(), [](std::string& word) { return word.data(); });
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);

  const auto start = std::chrono::steady_clock::now();
  pid_t process = -1;
  const int refused = posix_spawn(&process, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (refused != 0) {
    return {};
  }
  int status = 0;
  rusage usage{};
  while (wait4(process, &status, 0, &usage) < 0 && errno == EINTR) {
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  return {.succeeded = WIFEXITED(status) && WEXITSTATUS(status) == 0,
          .seconds = seconds.count(),
          .cpu_seconds = Seconds(usage.ru_utime) + Seconds(usage.ru_stime),
          .peak_bytes = 1024.0 * static_cast<double>(usage.ru_maxrss)};
}

/// The peak of this process's own memory. A started process counts that of the one it was cloned from as its
/// own (getrusage(2), ru_maxrss): nothing that needs much memory may run in this one before.
double OwnPeakBytes() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    if (double kibibytes = 0; word == "VmHWM:" && status >> kibibytes) {
      return 1024 * kibibytes;
    }
  }
  throw std::runtime_error("/proc/self/status has no VmHWM");
}

/// What is wrong with the answer, or nothing.
std::string Complaint(const Scene& scene, const Json& statistics, bool checked, double peak_bytes) {
  const auto above = [](const char* what, double is, double limit) {
    return std::string(what) + " " + std::to_string(is) + " is above " + std::to_string(limit);
  };
  if (statistics.at("stopped_by") != "error") {
    return "the bake did not reach its target";
  }
  if (checked) {
    const Json& measured = statistics.at("error").at("measured");
    if (!(measured.at("relative_rms").get<double>() <= scene.largest_error)) {
      return above("the measured error", measured.at("relative_rms"), scene.largest_error);
    }
    if (measured.at("missing") != 0) {
      return "the bake has holes";
    }
  }
  const double imbalance = statistics.at("energy").at("imbalance");
  if (!(imbalance <= kLargestImbalance)) {
    return above("the imbalance", imbalance, kLargestImbalance);
  }
  if (peak_bytes <= OwnPeakBytes()) {
    return "the peak memory is this process's own: run the bakes first";
  }
  if (scene.most_megabytes && peak_bytes > 1e6 * *scene.most_megabytes) {
    return above("the peak memory in MB", 1e-6 * peak_bytes, *scene.most_megabytes);
  }
  return {};
}

/// Counters, of the last bake: `cpu` s of all threads; `core` s of wall time between import and export, in
/// which rays are cast; `rays` of the bake, not the check's; `links`, `elements` (all nodes of the hierarchy)
/// of the last pass; `vertices` of the output; `error%` measured; `imbalance%`; `solve.embree%`,
/// `energy.embree%`, `gather.embree%` and, for the three, `all.embree%`: the share of the processor time that
/// is spent inside Embree; `MB` at the peak, 10⁶ bytes.
void Count(benchmark::State& state, const Json& statistics, const Run& run) {
  const auto counter = [&](const char* name, double value) { state.counters[name] = value; };
  const Json& time = statistics.at("time");
  const double core =
      time.at("solve").get<double>() + time.at("energy").get<double>() + time.at("gather").get<double>();
  const Json& last = statistics.at("iterations").back();
  counter("cpu", run.cpu_seconds);
  counter("core", core);
  counter("rays", statistics.at("rays").at("count"));
  counter("links", last.at("links"));
  counter("elements", last.at("elements"));
  counter("vertices", statistics.at("output").at("vertices"));
  if (const Json& measured = statistics.at("error").at("measured"); !measured.is_null()) {
    counter("error%", 100 * measured.at("relative_rms").get<double>());
  }
  counter("imbalance%", 100 * statistics.at("energy").at("imbalance").get<double>());
  for (const auto& [phase, share] : statistics.at("rays").at("share").items()) {
    state.counters[phase + ".embree%"] = 100 * share.get<double>();
  }
  counter("MB", 1e-6 * run.peak_bytes);
}

void BenchBake(benchmark::State& state, const Scene& scene, bool checked) {
  const Folder folder;
  const std::string program = RADBAKE_BINARY_DIR "/radbake";
  std::vector<std::string> words = {program,
                                    "bake",
                                    scene.path,
                                    "-o",
                                    folder.File("baked.glb"),
                                    "--statistics",
                                    folder.File("statistics.json"),
                                    "--threads",
                                    std::to_string(kThreads),
                                    "--progress",
                                    "none"};
  if (!checked) {
    words.insert(words.end(), {"--check", "0"});
  }
  while (state.KeepRunning()) {
    const Run run = RunProgram(words, folder.File("log"));
    if (!run.succeeded) {
      std::ifstream log(folder.File("log"));
      Fail(state, "radbake failed: " + std::string(std::istreambuf_iterator<char>(log), {}));
      return;
    }
    state.SetIterationTime(run.seconds);
    std::ifstream file(folder.File("statistics.json"));
    const Json statistics = Json::parse(file);
    if (const std::string complaint = Complaint(scene, statistics, checked, run.peak_bytes);
        !complaint.empty()) {
      Fail(state, complaint);
      return;
    }
    Count(state, statistics, run);
  }
}

}  // namespace

void RegisterBakes() {
  for (const bool checked : {true, false}) {
    for (const Scene& scene : kScenes) {
      if (!fs::exists(scene.path)) {
        continue;
      }
      const std::string name = "Bake/" + std::string(scene.name) + (checked ? "" : "/unchecked");
      benchmark::RegisterBenchmark(
          name.c_str(), [&scene, checked](benchmark::State& state) { BenchBake(state, scene, checked); })
          ->UseManualTime()
          ->Unit(benchmark::kMillisecond);
    }
  }
}

}  // namespace radbake::bench
