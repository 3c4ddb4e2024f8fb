/// Files that appear whole or not at all, and the signals that could interrupt their writing.
#pragma once

#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

namespace radbake::cli {

/// A file could not be written: exit code 1, unlike an InputError.
class OutputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct OutputFile {
  std::string path;  ///< a symbolic link is followed
  std::string_view bytes;
};

/// From now on SIGINT, SIGTERM and SIGHUP end the process with exit code 130, at once and with nothing left
/// that WriteWhole() had begun; what it has finished stays.
void ExitOnSignals();

/// Throws OutputError if a file at `path` could surely not be written: so that nobody waits for a bake first.
void CheckWritable(const std::string& path);

/// Writes each file beside its place, makes them durable, and only then renames them, all together. At most
/// two. Throws OutputError; then nothing is left of those that were not renamed.
void WriteWhole(std::span<const OutputFile> files);

}  // namespace radbake::cli
