#include "server/queue.h"

#include <sqlite3.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <limits>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <utility>

#include "schema.sql.h"
#include "schema_from_1.sql.h"

namespace radbake::server {
namespace {

constexpr std::array<std::string_view, 5> kStatusNames = {"queued", "running", "succeeded", "failed",
                                                          "canceled"};
constexpr int kSchemaVersion = 2;

// What Statement::ReadJob() reads.
const std::string kColumns =
    "id, status, scene, crashes, progress, created, started, ended, problem, owner, attempt, told, expires";

std::string Told(const Live& live) {
  return ToText({{"phase", live.phase}, {"statistics", live.statistics}});
}

// The two parts of a cursor: when the job was made, and its id.
std::optional<std::pair<std::int64_t, std::string>> ParseCursor(const std::string& text) {
  const std::size_t dash = std::min(text.find('-'), text.size());
  std::int64_t created = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + dash, created);
  if (error != std::errc() || end != text.data() + dash || dash + 1 >= text.size() || created < 0) {
    return std::nullopt;
  }
  return std::pair(created, text.substr(dash + 1));
}

[[noreturn]] void Fail(sqlite3* database) {
  throw QueueError(std::string("the queue: ") + sqlite3_errmsg(database));
}

void Execute(sqlite3* database, const char* sql) {
  if (sqlite3_exec(database, sql, nullptr, nullptr, nullptr) != SQLITE_OK) {
    Fail(database);
  }
}

// Undone unless it was committed.
class Transaction {
 public:
  explicit Transaction(sqlite3* database) : database_(database) { Execute(database, "BEGIN IMMEDIATE"); }
  ~Transaction() {
    if (!done_) {
      sqlite3_exec(database_, "ROLLBACK", nullptr, nullptr, nullptr);
    }
  }
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  void Commit() {
    Execute(database_, "COMMIT");
    done_ = true;
  }

 private:
  sqlite3* database_;
  bool done_ = false;
};

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
    job.status = StatusFrom(Text().value_or("")).value_or(job.status);
    job.scene = Text().value_or("");
    job.crashes = static_cast<int>(Integer());
    job.live.progress = Real();
    job.created = TimePoint().value_or(Time());
    job.started = TimePoint();
    job.ended = TimePoint();
    if (const std::optional<std::string> problem = Text()) {
      job.problem = ProblemFromJson(nlohmann::json::parse(*problem));
    }
    job.owner = Text().value_or("");
    job.attempt = static_cast<int>(Integer());
    const nlohmann::json told = nlohmann::json::parse(Text().value_or("{}"));
    job.live.phase = told.value("phase", "");
    job.live.statistics = told.value("statistics", nlohmann::json::object());
    job.expires = TimePoint();
    return job;
  }

  static std::optional<Job> ReadOne(sqlite3* database, const std::string& id) {
    Statement find(database, "SELECT " + kColumns + " FROM jobs WHERE id = ?", id);
    return find.Step() ? std::optional(find.ReadJob()) : std::nullopt;
  }

  static std::optional<Added> ReadKey(sqlite3* database, const std::string& owner,
                                      const IdempotencyKey& key) {
    Statement find(database, "SELECT job, digest FROM keys WHERE owner = ? AND key = ? AND created > ?",
                   owner, key.key, Now() - kKeyLife);
    if (!find.Step()) {
      return std::nullopt;
    }
    const std::string id = find.Text().value_or("");
    const bool same = find.Text().value_or("") == key.digest;
    return Added{same ? Added::Kind::kSame : Added::Kind::kOther, ReadOne(database, id).value_or(Job())};
  }

 private:
  void Bind(int index, std::string_view text) {
    Check(sqlite3_bind_text64(statement_, index, text.data(), text.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
  }
  void Bind(int index, Time time) {
    Check(sqlite3_bind_int64(statement_, index, time.time_since_epoch().count()));
  }
  void Bind(int index, std::int64_t number) { Check(sqlite3_bind_int64(statement_, index, number)); }
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

std::optional<Status> StatusFrom(std::string_view name) {
  const auto* const found = std::find(kStatusNames.begin(), kStatusNames.end(), name);
  return found == kStatusNames.end() ? std::nullopt
                                     : std::optional(static_cast<Status>(found - kStatusNames.begin()));
}

std::string Cursor(const Job& job) {
  return std::to_string(job.created.time_since_epoch().count()) + "-" + job.id;
}

bool IsCursor(const std::string& text) {
  return ParseCursor(text).has_value();
}

void Queue::Closer::operator()(sqlite3* database) const {
  sqlite3_close(database);
}

void Queue::Open(Connection& connection, const std::filesystem::path& file) {
  sqlite3* database = nullptr;
  const int result =
      sqlite3_open_v2(file.c_str(), &database, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, nullptr);
  connection.database.reset(database);
  if (result != SQLITE_OK) {
    throw QueueError("cannot open " + file.string() + ": " + sqlite3_errstr(result));
  }
  sqlite3_busy_timeout(database, 5000);
}

Queue::Queue(const std::filesystem::path& file, std::chrono::milliseconds keep) : keep_(keep) {
  Open(writer_, file);
  sqlite3* database = writer_.database.get();
  Execute(database, "PRAGMA journal_mode = WAL");
  Execute(database, "PRAGMA synchronous = FULL");
  Execute(database, "PRAGMA foreign_keys = ON");
  Transaction transaction(database);
  Statement version(database, "PRAGMA user_version");
  version.Step();
  const std::int64_t found = version.Integer();
  if (found < 0 || found > kSchemaVersion) {
    throw QueueError(file.string() + " is of version " + std::to_string(found) + ", this radbaked knows " +
                     std::to_string(kSchemaVersion));
  }
  version.Run();
  if (found == 1) {
    Execute(database, kSchemaFrom1);
  }
  Execute(database, kSchema);
  Execute(database, ("PRAGMA user_version = " + std::to_string(kSchemaVersion)).c_str());
  transaction.Commit();
  Open(reader_, file);
}

Queue::~Queue() = default;

Added Queue::Add(const NewJob& job) {
  const std::lock_guard lock(writer_.mutex);
  sqlite3* database = writer_.database.get();
  const Time now = Now();
  Transaction transaction(database);
  Added added;
  if (job.key) {
    Statement(database, "DELETE FROM keys WHERE owner = ? AND key = ? AND created <= ?", job.owner,
              job.key->key, now - kKeyLife)
        .Run();
    if (std::optional<Added> before = Statement::ReadKey(database, job.owner, *job.key)) {
      return std::move(*before);
    }
  }
  Statement insert(database,
                   "INSERT INTO jobs (id, owner, status, scene, created) VALUES (?, ?, 'queued', ?, ?)"
                   " RETURNING " +
                       kColumns,
                   job.id, job.owner, job.scene, now);
  insert.Step();
  added.job = insert.ReadJob();
  insert.Run();
  if (job.key) {
    Statement(database, "INSERT INTO keys (owner, key, digest, job, created) VALUES (?, ?, ?, ?, ?)",
              job.owner, job.key->key, job.key->digest, job.id, now)
        .Run();
  }
  transaction.Commit();
  return added;
}

std::optional<Job> Queue::Claim() {
  const std::lock_guard lock(writer_.mutex);
  sqlite3* database = writer_.database.get();
  Transaction transaction(database);
  Statement next(database, R"(
      SELECT min(sequence) FROM jobs AS job LEFT JOIN turns USING (owner) WHERE status = 'queued' GROUP BY owner
      ORDER BY (SELECT count(*) FROM jobs WHERE status = 'running' AND owner = job.owner), coalesce(taken, 0),
               min(sequence)
      LIMIT 1)");
  if (!next.Step()) {
    return std::nullopt;
  }
  const std::int64_t sequence = next.Integer();
  next.Run();
  Statement claim(database,
                  "UPDATE jobs SET status = 'running', started = ?, attempt = attempt + 1, progress = 0,"
                  " told = '{}' WHERE sequence = ? RETURNING " +
                      kColumns,
                  Now(), sequence);
  claim.Step();
  Job job = claim.ReadJob();
  claim.Run();
  Statement(database,
            "INSERT INTO turns (owner, taken) SELECT ?, coalesce(max(taken), 0) + 1 FROM turns WHERE true"
            " ON CONFLICT (owner) DO UPDATE SET taken = excluded.taken",
            job.owner)
      .Run();
  transaction.Commit();
  return job;
}

bool Queue::Finish(const std::string& id, int attempt, Status status, const Live& live,
                   const std::optional<Problem>& problem) {
  const std::lock_guard lock(writer_.mutex);
  const Time now = Now();
  return Statement(writer_.database.get(),
                   "UPDATE jobs SET status = ?, progress = ?, told = ?, problem = ?, ended = ?, expires = ?"
                   " WHERE id = ? AND attempt = ? AND status = 'running'",
                   ToString(status), live.progress, Told(live), problem, now, now + keep_, id, attempt)
             .Run() > 0;
}

bool Queue::Release(const std::string& id, int attempt, int crashes) {
  const std::lock_guard lock(writer_.mutex);
  return Statement(writer_.database.get(),
                   "UPDATE jobs SET status = 'queued', started = NULL, progress = 0, told = '{}',"
                   " crashes = ? WHERE id = ? AND attempt = ? AND status = 'running'",
                   crashes, id, attempt)
             .Run() > 0;
}

std::size_t Queue::ReleaseAll() {
  const std::lock_guard lock(writer_.mutex);
  return Statement(writer_.database.get(),
                   "UPDATE jobs SET status = 'queued', started = NULL, progress = 0, told = '{}'"
                   " WHERE status = 'running'")
      .Run();
}

bool Queue::Cancel(const std::string& id, const Live& live) {
  const std::lock_guard lock(writer_.mutex);
  const Time now = Now();
  return Statement(writer_.database.get(),
                   "UPDATE jobs SET status = 'canceled', progress = ?, told = ?, ended = ?, expires = ?"
                   " WHERE id = ? AND status IN ('queued', 'running')",
                   live.progress, Told(live), now, now + keep_, id)
             .Run() > 0;
}

bool Queue::Remove(const std::string& id) {
  const std::lock_guard lock(writer_.mutex);
  return Statement(writer_.database.get(), "DELETE FROM jobs WHERE id = ?", id).Run() > 0;
}

std::vector<std::string> Queue::Forget(Time now) {
  const std::lock_guard lock(writer_.mutex);
  sqlite3* database = writer_.database.get();
  Statement(database, "DELETE FROM keys WHERE created <= ?", now - kKeyLife).Run();
  std::vector<std::string> ids;
  Statement forget(database, "DELETE FROM jobs WHERE expires <= ? RETURNING id", now);
  while (forget.Step()) {
    ids.push_back(forget.Text().value_or(""));
  }
  return ids;
}

std::optional<Job> Queue::Find(const std::string& id) {
  const std::lock_guard lock(reader_.mutex);
  return Statement::ReadOne(reader_.database.get(), id);
}

std::vector<Job> Queue::List(const Page& page) {
  const auto [created, id] =
      ParseCursor(page.after).value_or(std::pair(std::numeric_limits<std::int64_t>::max(), std::string()));
  const std::string status(page.status ? ToString(*page.status) : "");
  const std::lock_guard lock(reader_.mutex);
  Statement list(reader_.database.get(),
                 "SELECT " + kColumns +
                     " FROM jobs WHERE owner = ? AND (created, id) < (?, ?) AND (? = '' OR status = ?)"
                     " ORDER BY created DESC, id DESC LIMIT ?",
                 page.owner, created, id, status, status, static_cast<std::int64_t>(page.limit));
  std::vector<Job> jobs;
  while (list.Step()) {
    jobs.push_back(list.ReadJob());
  }
  return jobs;
}

Waiting Queue::CountQueued(const std::string& owner) {
  const std::lock_guard lock(reader_.mutex);
  Statement count(reader_.database.get(),
                  "SELECT count(*), count(*) FILTER (WHERE owner = ?) FROM jobs WHERE status = 'queued'",
                  owner);
  count.Step();
  Waiting waiting;
  waiting.all = static_cast<std::size_t>(count.Integer());
  waiting.of_owner = static_cast<std::size_t>(count.Integer());
  return waiting;
}

std::map<Status, std::size_t> Queue::Count() {
  std::map<Status, std::size_t> counts;
  for (const std::string_view name : kStatusNames) {
    counts[StatusFrom(name).value_or(Status::kQueued)] = 0;
  }
  const std::lock_guard lock(reader_.mutex);
  Statement count(reader_.database.get(), "SELECT status, count(*) FROM jobs GROUP BY status");
  while (count.Step()) {
    if (const std::optional<Status> status = StatusFrom(count.Text().value_or(""))) {
      counts[*status] = static_cast<std::size_t>(count.Integer());
    }
  }
  return counts;
}

}  // namespace radbake::server
