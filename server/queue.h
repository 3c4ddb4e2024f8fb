/// The jobs, their states and their files: the contract of the service's one durable store.
///
/// Two databases keep it: SQLite, with the files in folders beside it (server/queue_sqlite.h), and
/// PostgreSQL, with the files in it too, so that any number of radbaked on any machines share it
/// (server/queue_postgres.h). One test suite holds for both.
///
/// What has been answered is on the disk. Every change is one statement that names the state it starts from,
/// so that a job that was canceled or deleted meanwhile is left as it is.
///
/// A worker holds a job by a lease. Whoever claims a job gets the number of this attempt, and all that it
/// writes names that number: one that has lost the job can change it no more. While it holds the job it
/// beats, which counts up the job's beats; a job whose count stands still for as long as a lease lasts, by
/// the clock of who watches it (server/queue_lease.h), is taken back. So no wall clock decides who holds a
/// job: clocks may differ and may be set, forwards or back. All that is assumed is that monotonic clocks go
/// about equally fast. The times that clients see, and when an ended job or a key is forgotten, are by the
/// database's wall clock; no job has started before it was made or ended before it has started, whatever was
/// done to that clock.
///
/// Thread-safe. Every function throws QueueError where the database cannot be reached, read or written;
/// whether a change has been made then is not known, and asking for it again does no harm.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "server/problem.h"

namespace radbake::server {

using Time = std::chrono::sys_time<std::chrono::milliseconds>;

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
  std::int64_t sequence = 0;  ///< in the order in which jobs came
  std::string id;
  std::string owner;  ///< whose job it is; empty where nobody needs a name
  Status status = Status::kQueued;
  std::string scene;  ///< relative to the job's folder
  int attempt = 0;    ///< how often a worker has taken it
  int crashes = 0;    ///< attempts that ended without an answer: the child's crashes and lost workers
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

/// One attempt at a job: what a worker holds.
struct Attempt {
  std::string id;
  int number = 0;
};

/// An attempt as seen from outside.
struct Held {
  Attempt attempt;
  std::int64_t beats = 0;
  std::string worker = {};  ///< who holds it
  bool operator==(const Held& other) const {
    return attempt.id == other.attempt.id && attempt.number == other.attempt.number && beats == other.beats;
  }
};

/// How an attempt ended with an answer.
struct Outcome {
  Status status = Status::kSucceeded;  ///< or failed
  Live live;
  std::optional<Problem> problem;  ///< of a failed one
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

/// The names of a result's files.
inline constexpr const char* kBakedFile = "baked.glb";
inline constexpr const char* kStatisticsFile = "statistics.json";

/// A file of a result, which never changes. For one thread at a time.
class StoredFile {
 public:
  StoredFile() = default;
  StoredFile(const StoredFile&) = delete;
  StoredFile& operator=(const StoredFile&) = delete;
  virtual ~StoredFile() = default;
  virtual std::uint64_t size() const = 0;
  /// At least one byte from `offset` < size() on, and at most `most`. Throws QueueError where the file cannot
  /// be read, also since it has been deleted meanwhile.
  virtual std::string Read(std::uint64_t offset, std::size_t most) = 0;
};

class Queue {
 public:
  /// Idempotency keys are kept for so long.
  static constexpr std::chrono::hours kKeyLife{24};
  /// So many attempts may end without an answer; then the job has failed.
  static constexpr int kAttempts = 3;
  static constexpr int kForgottenAtOnce = 20;

  Queue() = default;
  Queue(const Queue&) = delete;
  Queue& operator=(const Queue&) = delete;
  virtual ~Queue() = default;

  /// A new job, queued, with the files in `folder`, which it takes over; or the one that its key has made
  /// before, and then the folder is left as it is. The folder's name is the job's id; in SQLite it is in
  /// <data>/jobs.
  virtual Added Add(const NewJob& job, const std::filesystem::path& folder) = 0;
  /// Whether the queue has kept the folder of that name. One that it has not was left behind by who died
  /// making it.
  virtual bool KeepsFolder(const std::string& id) = 0;

  /// The next queued job, now running and held by this worker; nothing if there is none. Owners take turns:
  /// it is the oldest of the owner who has fewest jobs running, and among such, of whom none was taken for
  /// longest. Claims at the same moment may see the same turns.
  virtual std::optional<Job> Claim(const std::string& worker) = 0;
  /// Puts the upload of a job into a folder, which is made. Throws std::filesystem::filesystem_error where
  /// that cannot be written, and with std::errc::no_such_file_or_directory where the upload is not there.
  virtual void Fetch(const std::string& id, const std::filesystem::path& folder) = 0;
  /// The attempt goes on, so far. False if it has lost the job: then the other changes are refused alike.
  virtual bool Beat(const Attempt& attempt, const Live& live) = 0;
  /// The attempt has ended with an answer; that of success has its files in the folder `results`, which are
  /// moved or copied. Succeeded and stored is one.
  virtual bool Finish(const Attempt& attempt, const Outcome& outcome,
                      const std::filesystem::path& results) = 0;
  /// The job goes back to its place in the queue, by no fault of its own.
  virtual bool Release(const Attempt& attempt) = 0;
  /// The attempt has ended without an answer: the job goes back to its place in the queue or, after kAttempts
  /// of them, has failed for this reason.
  virtual bool Crash(const Attempt& attempt, const Problem& reason) = 0;

  /// All that is held, by whomever.
  virtual std::vector<Held> ListHeld() = 0;
  /// As Crash(), unless its worker has beaten since.
  virtual bool TakeBack(const Held& held, const Problem& reason) = 0;
  /// As Crash(), for all that a worker holds which is no more. How many there were.
  virtual std::size_t TakeBackFrom(const std::string& worker, const Problem& reason) = 0;

  /// A queued or running job is canceled, so far on if that is known here. False if it was neither.
  virtual bool Cancel(const std::string& id, const std::optional<Live>& live) = 0;
  /// Deletes it with its files. False if there was none.
  virtual bool Remove(const std::string& id) = 0;
  /// Removes the keys and the ended jobs whose time has come or will have so far ahead; of the jobs not more
  /// than kForgottenAtOnce, for that takes its time where their files are large. The jobs' ids.
  virtual std::vector<std::string> Forget(std::chrono::milliseconds ahead = {}) = 0;

  virtual std::optional<Job> Find(const std::string& id) = 0;
  virtual std::vector<Job> List(const Page& page) = 0;
  /// How many jobs wait.
  virtual Waiting CountQueued(const std::string& owner) = 0;
  /// How many jobs there are in each state.
  virtual std::map<Status, std::size_t> Count() = 0;
  /// A file of the result, by its name; null if it is not there.
  virtual std::unique_ptr<StoredFile> Open(const std::string& id, const std::string& name) = 0;

  /// Calls `hint`, from any thread, when there may be a job to claim, or one that is held may have been
  /// canceled. It takes the place of the one before, which is not called any more when this returns; an empty
  /// one ends it. It is a hint: what comes of another process may be missed. It must not call the queue.
  virtual void OnChange(std::function<void()> hint) = 0;
};

}  // namespace radbake::server
