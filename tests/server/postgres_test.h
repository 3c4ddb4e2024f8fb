/// A PostgreSQL server of the tests' own.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace radbake::server {

/// Its data are in a temporary folder, which is its socket's too; it dies with this process.
class PostgresServer {
 public:
  PostgresServer();
  ~PostgresServer();
  PostgresServer(const PostgresServer&) = delete;
  PostgresServer& operator=(const PostgresServer&) = delete;

  /// The one that all tests of this process share, started when it is first asked for.
  static PostgresServer& Shared();

  /// A new, empty database; its URL.
  std::string MakeDatabase();
  /// Kills it with all its processes, as the power would.
  void Kill();
  /// Starts it again, and waits until it answers.
  void Start();
  /// Stops it with all its processes, as they stand: it is there, and says nothing.
  void Halt();
  /// They go on.
  void Resume();

  /// Where its socket is.
  const std::filesystem::path& folder() const { return folder_; }

 private:
  std::filesystem::path folder_;
  pid_t pid_ = -1;
  std::vector<pid_t> halted_;
  int databases_ = 0;
};

/// Runs a statement in a database; the first field of its first row, or "".
std::string RunSql(const std::string& url, const std::string& sql);

}  // namespace radbake::server
