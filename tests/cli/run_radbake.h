/// Runs the real program as a user would, in a temporary folder of its own.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace radbake::testing {

struct Outcome {
  int code = -1;  ///< exit code; 128 + signal if one ended it
  std::string out;
  std::string error;
};

inline std::string ReadFile(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

inline std::string SceneFile(const std::string& name) {
  return RADBAKE_SOURCE_DIR "/scenes/" + name;
}

inline bool IsOneLine(const std::string& text) {
  return text.ends_with('\n') && std::ranges::count(text, '\n') == 1;
}

/// A folder for a test, with the program's standard output and error kept outside of it.
class RadbakeTest : public ::testing::Test {
 protected:
  RadbakeTest() {
    root_ = (std::filesystem::temp_directory_path() / "radbake-test-XXXXXX").string();
    EXPECT_NE(mkdtemp(root_.data()), nullptr);
    std::filesystem::create_directory(root_ + "/folder");
  }
  ~RadbakeTest() override { std::filesystem::remove_all(root_); }

  std::string File(const std::string& name) const { return root_ + "/folder/" + name; }
  void Write(const std::string& name, const std::string& content) const {
    std::ofstream(File(name), std::ios::binary) << content;
  }

  /// The names in the folder, sorted.
  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(root_ + "/folder")) {
      names.push_back(entry.path().filename());
    }
    std::ranges::sort(names);
    return names;
  }

  /// Starts the program; `error_terminal` stands for its standard error if it is not -1.
  pid_t Start(const std::vector<std::string>& arguments, int error_terminal = -1) const {
    std::vector<std::string> words{RADBAKE_BINARY_DIR "/radbake"};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv(words.size() + 1);
    std::ranges::transform(words, argv.begin(), [](std::string& word) { return word.data(); });
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC;
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, OutPath().c_str(), kFlags, 0600);
    if (error_terminal < 0) {
      posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, ErrorPath().c_str(), kFlags, 0600);
    } else {
      posix_spawn_file_actions_adddup2(&actions, error_terminal, STDERR_FILENO);
    }
    pid_t process = -1;
    EXPECT_EQ(posix_spawn(&process, argv[0], &actions, nullptr, argv.data(), environ), 0) << argv[0];
    posix_spawn_file_actions_destroy(&actions);
    return process;
  }

  Outcome Wait(pid_t process) const {
    int status = 0;
    EXPECT_EQ(waitpid(process, &status, 0), process);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), ReadFile(OutPath()),
            ReadFile(ErrorPath())};
  }

  Outcome Radbake(const std::vector<std::string>& arguments) const { return Wait(Start(arguments)); }

  /// Until the program has printed something, or ended.
  void WaitForOutput(pid_t process) const {
    siginfo_t ended{};
    while (ReadFile(OutPath()).empty() && ended.si_pid == 0) {
      usleep(1000);
      waitid(P_PID, static_cast<id_t>(process), &ended, WEXITED | WNOHANG | WNOWAIT);
    }
  }

 private:
  std::string OutPath() const { return root_ + "/out"; }
  std::string ErrorPath() const { return root_ + "/error"; }

  std::string root_;
};

}  // namespace radbake::testing
