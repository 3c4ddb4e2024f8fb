#include "solver/cli/output_files.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <system_error>
#include <vector>

namespace radbake::cli {
namespace {

constexpr int kInterrupted = 130;

// The handler may run on any thread at any moment: it sees only lock-free atomics and calls only what POSIX
// allows.
std::array<std::atomic<const char*>, 2> unfinished_paths;
std::atomic<bool> renaming = false;
static_assert(std::atomic<const char*>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

extern "C" void OnSignal(int /*signal*/) {
  if (renaming) {
    return;
  }
  for (const std::atomic<const char*>& path : unfinished_paths) {
    if (const char* const name = path) {
      unlink(name);
    }
  }
  // On a terminal the line may hold a progress bar.
  const std::string_view message =
      isatty(STDERR_FILENO) ? "\r\x1b[Kradbake: interrupted\n" : "radbake: interrupted\n";
  [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, message.data(), message.size());
  _exit(kInterrupted);
}

[[noreturn]] void Throw(const std::string& path, int error) {
  throw OutputError("cannot write " + path + ": " + std::generic_category().message(error));
}

std::filesystem::path Folder(const std::filesystem::path& path) {
  return path.has_parent_path() ? path.parent_path() : ".";
}

void WriteAll(int file, std::string_view bytes, const std::string& path) {
  while (!bytes.empty()) {
    const ssize_t written = write(file, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) {
      continue;
    }
    if (written < 0) {
      Throw(path, errno);
    }
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void SyncFolder(const std::filesystem::path& folder) {
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor >= 0) {
    fsync(descriptor);
    close(descriptor);
  }
}

/// The new content beside its place; gone with this object unless it was renamed.
class TemporaryFile {
 public:
  TemporaryFile(const OutputFile& file, std::atomic<const char*>& unfinished)
      : shown_(file.path),
        target_(std::filesystem::weakly_canonical(file.path)),
        path_(target_.string() + "." + std::to_string(getpid()) + ".part"),
        unfinished_(unfinished) {
    unfinished_ = path_.c_str();
    const int descriptor = open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (descriptor < 0) {
      unfinished_ = nullptr;
      Throw(shown_, errno);
    }
    try {
      WriteAll(descriptor, file.bytes, shown_);
      if (fsync(descriptor) != 0) {
        Throw(shown_, errno);
      }
    } catch (...) {
      close(descriptor);
      Remove();
      throw;
    }
    close(descriptor);
  }
  ~TemporaryFile() { Remove(); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  void Rename() {
    if (rename(path_.c_str(), target_.c_str()) != 0) {
      Throw(shown_, errno);
    }
    unfinished_ = nullptr;
    SyncFolder(Folder(target_));
  }

 private:
  void Remove() {
    if (unfinished_.exchange(nullptr) != nullptr) {
      unlink(path_.c_str());
    }
  }

  std::string shown_;
  std::filesystem::path target_;
  std::string path_;
  std::atomic<const char*>& unfinished_;
};

/// Signals are ignored while it lives: all files are renamed or none.
class HoldSignals {
 public:
  HoldSignals() { renaming = true; }
  ~HoldSignals() { renaming = false; }
  HoldSignals(const HoldSignals&) = delete;
  HoldSignals& operator=(const HoldSignals&) = delete;
};

}  // namespace

void ExitOnSignals() {
  struct sigaction action = {};
  action.sa_handler = OnSignal;
  sigfillset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    sigaction(signal, &action, nullptr);
  }
}

void CheckWritable(const std::string& path) {
  std::error_code error;
  const std::filesystem::path target = std::filesystem::weakly_canonical(path, error);
  if (error) {
    Throw(path, error.value());
  }
  // A rename would replace a device such as /dev/null.
  if (std::filesystem::exists(target, error) && !std::filesystem::is_regular_file(target, error)) {
    throw OutputError("cannot write " + path + ": not a regular file");
  }
  if (access(Folder(target).c_str(), W_OK | X_OK) != 0) {
    Throw(path, errno);
  }
}

void WriteWhole(std::span<const OutputFile> files) {
  std::vector<std::unique_ptr<TemporaryFile>> temporaries;
  temporaries.reserve(files.size());
  for (std::size_t i = 0; i < files.size(); ++i) {
    temporaries.push_back(std::make_unique<TemporaryFile>(files[i], unfinished_paths.at(i)));
  }
  const HoldSignals hold;
  for (const std::unique_ptr<TemporaryFile>& temporary : temporaries) {
    temporary->Rename();
  }
}

}  // namespace radbake::cli
