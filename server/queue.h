/// The jobs and their states, in SQLite: what was answered is on the disk (WAL, synchronous=FULL).
///
/// Every change is one statement that names the state it starts from, so that a job that was canceled or
/// deleted meanwhile is left as it is; what a worker writes names its attempt too, so that one that has lost
/// the job can change it no more. Thread-safe. All functions throw QueueError.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "server/problem.h"

struct sqlite3;

namespace radbake::server {

using Time = std::chrono::sys_time<std::chrono::milliseconds>;
Time Now();

enum class Status { kQueued, kRunning, kSucceeded, kFailed, kCanceled };
std::string_view ToString(Status status);
std::optional<Status> StatusFrom(std::string_view name);
inline bool Ended(Status status) {
  return status != Status::kQueued && status != Status::kRunning;
}

/// What the child of a job has told last.
struct Live {
  std::string phase;                                     ///< empty: nothing yet
  double progress = 0;                                   ///< 0 to 1
  nlohmann::json statistics = nlohmann::json::object();  ///< as far as told
};

struct Job {
  std::string id;
  std::string owner;  ///< whose job it is; empty where nobody needs a name
  Status status = Status::kQueued;
  std::string scene;  ///< relative to the job's folder
  int attempt = 0;    ///< how often a worker has taken it
  int crashes = 0;    ///< children of this job that ended without an answer
  Live live;          ///< as last written down; while it runs, its worker knows more
  Time created;
  std::optional<Time> started;
  std::optional<Time> ended;
  std::optional<Time> expires;     ///< of an ended job: when it is forgotten
  std::optional<Problem> problem;  ///< of a failed job
};

/// An Idempotency-Key, and a digest of the payload that it came with.
struct IdempotencyKey {
  std::string key;
  std::string digest;
};

struct NewJob {
  std::string id;
  std::string owner;
  std::string scene;
  std::optional<IdempotencyKey> key;
};

struct Added {
  enum class Kind {
    kNew,
    kSame,  ///< the key has come with the same payload before: this is its job
    kOther  ///< the key has come with another payload before: `job` is that one's, and nothing was added
  };
  Kind kind = Kind::kNew;
  Job job;
};

struct Waiting {
  std::size_t all = 0;
  std::size_t of_owner = 0;
};

/// Which jobs a page shows: newest first.
struct Page {
  std::string owner;
  std::optional<Status> status;  ///< nothing: all
  std::string after;             ///< Cursor() of the last job of the page before; empty: from the newest on
  std::size_t limit = 50;
};

/// Where a page ends: opaque to clients. Holds its place when jobs around it are deleted.
std::string Cursor(const Job& job);
bool IsCursor(const std::string& text);

class QueueError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class Queue {
 public:
  /// Idempotency keys are kept for so long.
  static constexpr std::chrono::hours kKeyLife{24};

  /// Opens or makes the database. Jobs are forgotten so long after their end.
  explicit Queue(const std::filesystem::path& file, std::chrono::milliseconds keep = std::chrono::hours(24));
  ~Queue();
  Queue(const Queue&) = delete;
  Queue& operator=(const Queue&) = delete;

  /// A new job, queued; or the one that its key has made before.
  Added Add(const NewJob& job);
  /// The next queued job, now running; nothing if there is none. Owners take turns: it is the oldest of the
  /// owner who has fewest jobs running, and among such, of whom none was taken for longest.
  std::optional<Job> Claim();
  /// An attempt has ended. False if the job does not run, or not in this attempt.
  bool Finish(const std::string& id, int attempt, Status status, const Live& live,
              const std::optional<Problem>& problem);
  /// A running job goes back to its place in the queue, with so many crashes behind it. False as above.
  bool Release(const std::string& id, int attempt, int crashes);
  /// The same for all running jobs: those of a server that is no more. How many there were.
  std::size_t ReleaseAll();
  /// A queued or running job is canceled, so far on. False if it was neither.
  bool Cancel(const std::string& id, const Live& live);
  /// False if there was none.
  bool Remove(const std::string& id);
  /// Removes the ended jobs and the keys whose time has come. The jobs' ids.
  std::vector<std::string> Forget(Time now);
  std::optional<Job> Find(const std::string& id);
  std::vector<Job> List(const Page& page);
  /// How many jobs wait.
  Waiting CountQueued(const std::string& owner);
  /// How many jobs there are in each state.
  std::map<Status, std::size_t> Count();

 private:
  class Statement;
  struct Closer {
    void operator()(sqlite3* database) const;
  };
  /// A connection to the database, for one thread at a time.
  struct Connection {
    std::mutex mutex;
    std::unique_ptr<sqlite3, Closer> database;
  };
  static void Open(Connection& connection, const std::filesystem::path& file);

  std::chrono::milliseconds keep_;
  Connection writer_;
  Connection reader_;  ///< so that nobody who only looks waits for the disk
};

}  // namespace radbake::server
