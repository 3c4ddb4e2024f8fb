/// The queue in SQLite, with the files beside it:
///
///     DIR/jobs.sqlite              WAL, synchronous=FULL
///     DIR/jobs/<id>/               the job's upload, as it was handed over, and
///     DIR/jobs/<id>/baked.glb, …   its result
///
/// Any number of processes of one machine may share it. Hints (OnChange) come of this process alone.
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>

#include "server/queue_sql.h"

struct sqlite3;

namespace radbake::server {

class SqliteQueue final : public SqlQueue {
 public:
  /// Opens or makes the database in a folder that is there. Jobs are forgotten so long after their end.
  /// Throws QueueError, also where the database is of a later version.
  explicit SqliteQueue(const std::filesystem::path& data,
                       std::chrono::milliseconds keep = std::chrono::hours(24));
  ~SqliteQueue() override;

  Added Add(const NewJob& job, const std::filesystem::path& folder) override;
  bool KeepsFolder(const std::string& id) override;
  std::optional<Job> Claim(const std::string& worker) override;
  void Fetch(const std::string& id, const std::filesystem::path& folder) override;
  bool Finish(const Attempt& attempt, const Outcome& outcome, const std::filesystem::path& results) override;
  bool Remove(const std::string& id) override;
  std::vector<std::string> Forget(std::chrono::milliseconds ahead) override;
  std::unique_ptr<StoredFile> Open(const std::string& id, const std::string& name) override;
  void OnChange(std::function<void()> hint) override;

 private:
  class Connection;

  void Transact(const std::function<void(SqlConnection&)>& work) override;
  SqlResult Read(const std::string& sql, const std::vector<SqlValue>& values) override;
  SqlResult Write(const std::string& sql, const std::vector<SqlValue>& values) override;
  void Hint() override;
  std::filesystem::path Folder(const std::string& id) const { return jobs_ / id; }

  std::filesystem::path jobs_;
  std::mutex write_mutex_;
  std::unique_ptr<Connection> writer_;
  std::mutex read_mutex_;
  std::unique_ptr<Connection> reader_;  ///< so that nobody who only looks waits for the disk
  std::mutex hint_mutex_;
  std::function<void()> hint_;
};

}  // namespace radbake::server
