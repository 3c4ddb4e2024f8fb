#include "server/files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/random.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>

namespace radbake::server {
namespace {

// A child that had no time to close its descriptors holds the lock of its killed parent for a moment.
constexpr std::chrono::seconds kLockPatience{2};

[[noreturn]] void FailAt(const std::string& what, const std::filesystem::path& path) {
  throw std::system_error(errno, std::generic_category(), what + " " + path.string());
}

Descriptor Open(const std::filesystem::path& path, int flags) {
  Descriptor file(::open(path.c_str(), flags | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!file.open()) {
    FailAt("cannot open", path);
  }
  return file;
}

void Sync(const Descriptor& file, const std::filesystem::path& path) {
  if (::fsync(file.get()) != 0) {
    FailAt("cannot sync", path);
  }
}

}  // namespace

Descriptor::Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  if (this != &other) {
    Close();
    number_ = std::exchange(other.number_, -1);
  }
  return *this;
}

Descriptor::~Descriptor() {
  Close();
}

void Descriptor::Close() {
  if (open()) {
    ::close(std::exchange(number_, -1));
  }
}

NewFile::NewFile(std::filesystem::path temporary)
    : temporary_(std::move(temporary)), file_(Open(temporary_, O_WRONLY | O_CREAT | O_EXCL)) {}

NewFile::~NewFile() {
  if (file_.open()) {
    ::unlink(temporary_.c_str());
  }
}

void NewFile::Append(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file_.get(), bytes.data(), bytes.size());
    if (written < 0 && errno != EINTR) {
      FailAt("cannot write", temporary_);
    }
    bytes.remove_prefix(written < 0 ? 0 : static_cast<std::size_t>(written));
  }
}

void NewFile::Publish(const std::filesystem::path& path) {
  std::filesystem::rename(temporary_, path);
  file_.Close();
}

void SyncFile(const std::filesystem::path& path) {
  Sync(Open(path, O_RDONLY), path);
}

void SyncFolder(const std::filesystem::path& folder) {
  Sync(Open(folder, O_RDONLY | O_DIRECTORY), folder);
}

void SyncTree(const std::filesystem::path& folder) {
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    Sync(Open(entry.path(), O_RDONLY), entry.path());
  }
  SyncFolder(folder);
}

Descriptor LockFolder(const std::filesystem::path& folder, const std::string& name) {
  Descriptor lock = Open(folder / name, O_RDWR | O_CREAT);
  const auto end = std::chrono::steady_clock::now() + kLockPatience;
  while (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      continue;
    }
    if (errno == EWOULDBLOCK) {
      throw std::runtime_error("another radbaked uses the data folder " + folder.string());
    }
    FailAt("cannot lock", folder);
  }
  return lock;
}

std::string RandomId() {
  std::array<unsigned char, 16> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw std::system_error(errno, std::generic_category(), "cannot get random bits");
  }
  std::string id;
  for (const unsigned char byte : bytes) {
    id += "0123456789abcdef"[byte >> 4U];
    id += "0123456789abcdef"[byte & 0xFU];
  }
  return id;
}

}  // namespace radbake::server
