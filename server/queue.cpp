#include "server/queue.h"

#include <sqlite3.h>

#include <array>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "schema.sql.h"

namespace radbake::server {
namespace {

constexpr std::array<std::string_view, 5> kStatusNames = {"queued", "running", "succeeded", "failed",
                                                          "canceled"};
constexpr int kSchemaVersion = 1;

// What Statement::ReadJob() reads.
const std::string kColumns = "id, status, scene, crashes, progress, created, started, ended, problem";

[[noreturn]] void Fail(sqlite3* database) {
  throw QueueError(std::string("the queue: ") + sqlite3_errmsg(database));
}

void Execute(sqlite3* database, const char* sql) {
  if (sqlite3_exec(database, sql, nullptr, nullptr, nullptr) != SQLITE_OK) {
    Fail(database);
  }
}

}  // namespace

// One statement from bind to end. Columns are read in the order in which they stand.
class Queue::Statement {
 public:
  template <typename... Arguments>
  Statement(sqlite3* database, const std::string& sql, const Arguments&... arguments) : database_(database) {
    if (sqlite3_prepare_v2(database, sql.c_str(), -1, &statement_, nullptr) != SQLITE_OK) {
      Fail(database);
    }
    int index = 0;
    (Bind(++index, arguments), ...);
  }
  ~Statement() { sqlite3_finalize(statement_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  /// True: there is a row. False: done, and on the disk.
  bool Step() {
    const int result = sqlite3_step(statement_);
    if (result != SQLITE_ROW && result != SQLITE_DONE) {
      Fail(database_);
    }
    column_ = -1;
    return result == SQLITE_ROW;
  }

  /// Runs it to its end; how many rows it changed.
  std::size_t Run() {
    while (Step()) {
    }
    return static_cast<std::size_t>(sqlite3_changes(database_));
  }

  std::int64_t Integer() { return sqlite3_column_int64(statement_, ++column_); }
  double Real() { return sqlite3_column_double(statement_, ++column_); }
  std::optional<std::string> Text() {
    const unsigned char* text = sqlite3_column_text(statement_, ++column_);
    return text == nullptr ? std::nullopt : std::optional<std::string>(reinterpret_cast<const char*>(text));
  }
  std::optional<Time> TimePoint() {
    const bool null = sqlite3_column_type(statement_, ++column_) == SQLITE_NULL;
    return null ? std::nullopt
                : std::optional(Time(std::chrono::milliseconds(sqlite3_column_int64(statement_, column_))));
  }

  Job ReadJob() {
    Job job;
    job.id = Text().value_or("");
    const std::string status = Text().value_or("");
    for (std::size_t i = 0; i < kStatusNames.size(); ++i) {
      job.status = kStatusNames[i] == status ? static_cast<Status>(i) : job.status;
    }
    job.scene = Text().value_or("");
    job.crashes = static_cast<int>(Integer());
    job.progress = Real();
    job.created = TimePoint().value_or(Time());
    job.started = TimePoint();
    job.ended = TimePoint();
    if (const std::optional<std::string> problem = Text()) {
      job.problem = ProblemFromJson(nlohmann::json::parse(*problem));
    }
    return job;
  }

 private:
  void Bind(int index, std::string_view text) {
    Check(sqlite3_bind_text64(statement_, index, text.data(), text.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
  }
  void Bind(int index, Time time) {
    Check(sqlite3_bind_int64(statement_, index, time.time_since_epoch().count()));
  }
  void Bind(int index, int number) { Check(sqlite3_bind_int64(statement_, index, number)); }
  void Bind(int index, double number) { Check(sqlite3_bind_double(statement_, index, number)); }
  void Bind(int index, const std::optional<Problem>& problem) {
    if (problem) {
      Bind(index, std::string_view(ToText(ToJson(*problem))));
    } else {
      Check(sqlite3_bind_null(statement_, index));
    }
  }
  void Check(int result) {
    if (result != SQLITE_OK) {
      Fail(database_);
    }
  }

  sqlite3* database_;
  sqlite3_stmt* statement_ = nullptr;
  int column_ = -1;
};

Time Now() {
  return std::chrono::time_point_cast<std::chrono::milliseconds>(std::chrono::system_clock::now());
}

std::string_view ToString(Status status) {
  return kStatusNames.at(static_cast<std::size_t>(status));
}

void Queue::Closer::operator()(sqlite3* database) const {
  sqlite3_close(database);
}

Queue::Queue(const std::filesystem::path& file) {
  sqlite3* database = nullptr;
  const int result =
      sqlite3_open_v2(file.c_str(), &database, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, nullptr);
  database_.reset(database);
  if (result != SQLITE_OK) {
    throw QueueError("cannot open " + file.string() + ": " + sqlite3_errstr(result));
  }
  sqlite3_busy_timeout(database, 5000);
  Execute(database, "PRAGMA journal_mode = WAL");
  Execute(database, "PRAGMA synchronous = FULL");
  Statement version(database, "PRAGMA user_version");
  version.Step();
  const std::int64_t found = version.Integer();
  if (found != 0 && found != kSchemaVersion) {
    throw QueueError(file.string() + " is of version " + std::to_string(found) + ", this radbaked knows " +
                     std::to_string(kSchemaVersion));
  }
  version.Run();
  Execute(database, kSchema);
  Execute(database, ("PRAGMA user_version = " + std::to_string(kSchemaVersion)).c_str());
}

Queue::~Queue() = default;

Job Queue::Add(const std::string& id, const std::string& scene) {
  const std::lock_guard lock(mutex_);
  const Time now = Now();
  Statement(database_.get(), "INSERT INTO jobs (id, status, scene, created) VALUES (?, 'queued', ?, ?)", id,
            scene, now)
      .Run();
  Job job;
  job.id = id;
  job.scene = scene;
  job.created = now;
  return job;
}

std::optional<Job> Queue::Claim() {
  const std::lock_guard lock(mutex_);
  Statement claim(database_.get(),
                  "UPDATE jobs SET status = 'running', started = ? WHERE sequence ="
                  " (SELECT min(sequence) FROM jobs WHERE status = 'queued') RETURNING " +
                      kColumns,
                  Now());
  if (!claim.Step()) {
    return std::nullopt;
  }
  Job job = claim.ReadJob();
  claim.Run();
  return job;
}

bool Queue::Finish(const std::string& id, Status status, double progress,
                   const std::optional<Problem>& problem) {
  const std::lock_guard lock(mutex_);
  return Statement(database_.get(),
                   "UPDATE jobs SET status = ?, progress = ?, problem = ?, ended = ?"
                   " WHERE id = ? AND status = 'running'",
                   ToString(status), progress, problem, Now(), id)
             .Run() > 0;
}

bool Queue::Release(const std::string& id, int crashes) {
  const std::lock_guard lock(mutex_);
  return Statement(database_.get(),
                   "UPDATE jobs SET status = 'queued', started = NULL, crashes = ?"
                   " WHERE id = ? AND status = 'running'",
                   crashes, id)
             .Run() > 0;
}

std::size_t Queue::ReleaseAll() {
  const std::lock_guard lock(mutex_);
  return Statement(database_.get(),
                   "UPDATE jobs SET status = 'queued', started = NULL WHERE status = 'running'")
      .Run();
}

bool Queue::Cancel(const std::string& id, double progress) {
  const std::lock_guard lock(mutex_);
  return Statement(database_.get(),
                   "UPDATE jobs SET status = 'canceled', progress = ?, ended = ?"
                   " WHERE id = ? AND status IN ('queued', 'running')",
                   progress, Now(), id)
             .Run() > 0;
}

bool Queue::Remove(const std::string& id) {
  const std::lock_guard lock(mutex_);
  return Statement(database_.get(), "DELETE FROM jobs WHERE id = ?", id).Run() > 0;
}

std::optional<Job> Queue::Find(const std::string& id) {
  const std::lock_guard lock(mutex_);
  Statement find(database_.get(), "SELECT " + kColumns + " FROM jobs WHERE id = ?", id);
  if (!find.Step()) {
    return std::nullopt;
  }
  return find.ReadJob();
}

}  // namespace radbake::server
