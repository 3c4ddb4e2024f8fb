/// The jobs and their states, in SQLite: what was answered is on the disk (WAL, synchronous=FULL).
///
/// Every change is one statement that names the state it starts from, so that a job that was canceled or
/// deleted meanwhile is left as it is. Thread-safe. All functions throw QueueError.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "server/problem.h"

struct sqlite3;

namespace radbake::server {

using Time = std::chrono::sys_time<std::chrono::milliseconds>;
Time Now();

enum class Status { kQueued, kRunning, kSucceeded, kFailed, kCanceled };
std::string_view ToString(Status status);
inline bool Ended(Status status) {
  return status != Status::kQueued && status != Status::kRunning;
}

struct Job {
  std::string id;
  Status status = Status::kQueued;
  std::string scene;    ///< relative to the job's folder
  int crashes = 0;      ///< children of this job that ended without an answer
  double progress = 0;  ///< when it ended; while it runs, its worker knows
  Time created;
  std::optional<Time> started;
  std::optional<Time> ended;
  std::optional<Problem> problem;  ///< of a failed job
};

class QueueError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class Queue {
 public:
  /// Opens or makes the database.
  explicit Queue(const std::filesystem::path& file);
  ~Queue();
  Queue(const Queue&) = delete;
  Queue& operator=(const Queue&) = delete;

  /// A new job, queued.
  Job Add(const std::string& id, const std::string& scene);
  /// The oldest queued job, now running; nothing if there is none.
  std::optional<Job> Claim();
  /// A running job has ended. False if it runs no longer.
  bool Finish(const std::string& id, Status status, double progress, const std::optional<Problem>& problem);
  /// A running job goes back to its place in the queue, with so many crashes behind it. False if it runs no
  /// longer.
  bool Release(const std::string& id, int crashes);
  /// The same for all running jobs: those of a server that is no more. How many there were.
  std::size_t ReleaseAll();
  /// A queued or running job is canceled, so far on. False if it was neither.
  bool Cancel(const std::string& id, double progress);
  /// False if there was none.
  bool Remove(const std::string& id);
  std::optional<Job> Find(const std::string& id);

 private:
  class Statement;
  struct Closer {
    void operator()(sqlite3* database) const;
  };

  std::mutex mutex_;
  std::unique_ptr<sqlite3, Closer> database_;
};

}  // namespace radbake::server
