/// The queue in PostgreSQL, with the files in it: any number of radbaked on any machines share it, and need
/// nothing else of each other.
///
/// All is in the schema `radbake` of the database; it is made
/// with the first connection, and until that can be had the queue is an empty promise: every function throws
/// QueueError. So a database that comes late, goes and comes back, or hangs for a while is waited for without
/// harm, and no function waits for it for much longer than its patience. One process
/// has kConnections connections at most, and one more to listen.
///
/// Files are kept in pieces of kPiece bytes and are never whole in memory. Each may have up to 2^31 pieces
/// (512 TiB); --max-upload and --job-file-size are what limits them. Claims are one statement (FOR UPDATE
/// SKIP LOCKED). LISTEN/NOTIFY on the channel `radbake` tells all instances what may have changed.
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "server/queue_postgres_pool.h"
#include "server/queue_sql.h"

namespace radbake::server {

class PostgresQueue final : public SqlQueue {
 public:
  static constexpr std::size_t kPiece = 256 << 10U;

  /// `url`: postgresql://…, or key=value pairs, as libpq takes them. Connects to nothing yet. Throws
  /// QueueError for a URL that is none. A database that takes longer than `patience` for a statement counts
  /// as away.
  explicit PostgresQueue(const std::string& url, std::chrono::milliseconds keep = std::chrono::hours(24),
                         std::chrono::seconds patience = std::chrono::seconds(5));
  ~PostgresQueue() override;

  Added Add(const NewJob& job, const std::filesystem::path& folder) override;
  bool KeepsFolder(const std::string& id) override;
  std::optional<Job> Claim(const std::string& worker) override;
  void Fetch(const std::string& id, const std::filesystem::path& folder) override;
  bool Finish(const Attempt& attempt, const Outcome& outcome, const std::filesystem::path& results) override;
  std::unique_ptr<StoredFile> Open(const std::string& id, const std::string& name) override;
  void OnChange(std::function<void()> hint) override;

 private:
  void Transact(const std::function<void(SqlConnection&)>& work) override;
  SqlResult Read(const std::string& sql, const std::vector<SqlValue>& values) override;
  SqlResult Write(const std::string& sql, const std::vector<SqlValue>& values) override;
  void Hint() override;

  PostgresPool pool_;
  std::unique_ptr<PostgresListener> listener_;
};

}  // namespace radbake::server
