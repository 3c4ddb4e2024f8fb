/// The service without HTTP: the queue, the drafts of new jobs, and the workers, with a folder for what is of
/// this process alone.
///
///     DIR/lock                    held by the radbaked that takes uploads here
///     DIR/worker.lock             held by the one that bakes here
///     DIR/worker                  what its workers are called in the queue
///     DIR/work/<id>-<attempt>/    a running bake
///
/// and where the queue is in SQLite
///
///     DIR/jobs.sqlite             the queue
///     DIR/jobs/<id>/              the files of a job, from its draft on
///
/// where it is in PostgreSQL
///
///     DIR/drafts/<id>/            the files of a job until it is queued
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/files.h"
#include "server/metrics.h"
#include "server/queue.h"
#include "server/trouble_log.h"
#include "server/worker.h"

namespace radbake::server {

/// The files of a job that is not queued yet, in its folder, as a bake finds them.
struct JobFiles {
  std::filesystem::path folder;

  std::filesystem::path Parameters() const { return folder / "parameters.json"; }
  std::filesystem::path Upload() const { return folder / "upload"; }  ///< the scene and its resources
};

/// The folder of a job that is not queued yet. Removed again unless Jobs::Submit() took it.
class Draft {
 public:
  explicit Draft(JobFiles files);
  Draft(Draft&& other) noexcept;
  ~Draft();
  const JobFiles& files() const { return files_; }

 private:
  friend class Jobs;
  JobFiles files_;
  bool taken_ = false;
};

/// What a client hands in with its files.
struct Submission {
  std::string owner;
  std::string scene;  ///< relative to the job's folder
  std::optional<IdempotencyKey> key;
};

/// What one process does.
enum class Role {
  kAll,
  kApi,    ///< takes uploads and answers for all jobs, and bakes none
  kWorker  ///< bakes
};

/// Thread-safe. Functions of the queue throw QueueError as that does.
class Jobs {
 public:
  struct Options {
    Workers::Options workers;
    std::chrono::milliseconds keep = std::chrono::hours(24);  ///< how long ended jobs are kept
    std::uint64_t least_free = 0;              ///< bytes of the disk below which no job should come
    std::string database;                      ///< the URL of PostgreSQL; empty: SQLite
    std::chrono::seconds database_timeout{5};  ///< how long that may take for a statement
    Role role = Role::kAll;
  };

  /// Takes the data folder (and makes it if need be), removes what belongs to no job, and starts the workers,
  /// which queue again what was running when the last server here ended. An ended job is forgotten, with its
  /// files, when it has been kept long enough. Throws std::exception with what is wrong; a PostgreSQL that
  /// cannot be reached yet is waited for.
  Jobs(const std::filesystem::path& data, const Options& options);
  ~Jobs();
  Jobs(const Jobs&) = delete;
  Jobs& operator=(const Jobs&) = delete;

  Draft Begin();
  /// Makes the draft's files durable, then queues the job. When this returns, the job will be done, whatever
  /// happens to this process. Where the key has come before, nothing is queued and the draft is dropped.
  Added Submit(Draft draft, Submission submission);
  /// A running job as its worker knows it, if that is here.
  std::optional<Job> Find(const std::string& id);
  /// A page of jobs, newest first. How to go on is Cursor() of its last.
  std::vector<Job> List(const Page& page);
  Waiting CountQueued(const std::string& owner) { return queue_->CountQueued(owner); }
  std::map<Status, std::size_t> Count() { return queue_->Count(); }
  /// What keeps jobs from being taken and baked now (the database, the disk, the workers), in a sentence;
  /// empty: nothing.
  std::string Trouble();
  /// Bytes that the disk of the data folder has left; nothing if that is gone.
  std::optional<std::uint64_t> FreeBytes() const;
  Metrics& metrics() { return metrics_; }
  Role role() const { return role_; }
  /// A file of the result of a job that has succeeded; null if it is not there.
  std::unique_ptr<StoredFile> Open(const std::string& id, const std::string& name) {
    return queue_->Open(id, name);
  }
  /// From now on no job is taken from the queue, and the grace of the running ones begins. All else goes on.
  void Retire();
  /// False if the job has ended already or is not there.
  bool Cancel(const std::string& id);
  /// Stops and forgets the job, with its files. False if it is not there.
  bool Remove(const std::string& id);

 private:
  void RemoveDrafts();
  void Forget();
  std::optional<Live> FindLive(const std::string& id) const;

  std::filesystem::path folder_;
  std::chrono::milliseconds keep_;
  std::uint64_t least_free_;
  Role role_;
  Metrics metrics_;
  Descriptor lock_;
  Descriptor worker_lock_;
  std::unique_ptr<Queue> queue_;
  std::optional<Workers> workers_;
  std::mutex mutex_;
  std::condition_variable stopped_;
  bool stopping_ = false;
  TroubleLog forgetting_{"jobs are forgotten again"};
  std::thread forgetter_;
};

/// The job as JSON: the body of an answer.
nlohmann::json ToJson(const Job& job);

}  // namespace radbake::server
