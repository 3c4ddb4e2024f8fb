/// Files that appear whole or not at all, and that are still there after a power cut.
///
/// All functions throw std::system_error, with the path in its text.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace radbake::server {

/// Owns an open file descriptor, which no child inherits.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int number) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept;
  Descriptor& operator=(Descriptor&& other) noexcept;
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor();

  int get() const { return number_; }
  bool open() const { return number_ >= 0; }
  void Close();

 private:
  int number_ = -1;
};

/// A file while it is written, under a temporary name. Removed again unless it was published.
class NewFile {
 public:
  /// `temporary` must not exist and be on the same file system as the final path.
  explicit NewFile(std::filesystem::path temporary);
  NewFile(NewFile&&) = delete;
  ~NewFile();

  void Append(std::string_view bytes);
  /// Gives the file its name, replacing what had it. Durable after SyncTree().
  void Publish(const std::filesystem::path& path);

 private:
  std::filesystem::path temporary_;
  Descriptor file_;
};

/// Makes the content of a file durable that somebody else wrote.
void SyncFile(const std::filesystem::path& path);

/// Makes the names inside a folder durable.
void SyncFolder(const std::filesystem::path& folder);

/// Makes a folder durable with all that is in it.
void SyncTree(const std::filesystem::path& folder);

/// An exclusive lock on a file of the folder, for as long as the descriptor lives, and for as long as the
/// process lives. Throws std::runtime_error where another process holds it for longer than a moment.
Descriptor LockFolder(const std::filesystem::path& folder, const std::string& name);

/// 128 random bits as 32 lower-case hexadecimal digits.
std::string RandomId();

}  // namespace radbake::server
