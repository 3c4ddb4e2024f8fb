#include "server/queue_sqlite.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <system_error>
#include <utility>

#include "schema.sql.h"
#include "schema_from_1.sql.h"
#include "schema_from_2.sql.h"
#include "server/files.h"

namespace radbake::server {
namespace {

constexpr int kSqliteSchemaVersion = 3;
constexpr int kLockMilliseconds = 5000;  // milliseconds that another process may take to write
const char* const kSqliteNow = "CAST(round((julianday('now') - 2440587.5) * 86400000.0) AS INTEGER)";

// What the file system refuses is the queue's to report.
template <typename Work>
auto OnDisk(const Work& work) {
  try {
    return work();
  } catch (const std::system_error& error) {
    throw QueueError(std::string("the queue: ") + error.what());
  }
}

class FileOnDisk final : public StoredFile {
 public:
  FileOnDisk(Descriptor file, std::uint64_t size) : file_(std::move(file)), size_(size) {}
  std::uint64_t size() const override { return size_; }
  std::string Read(std::uint64_t offset, std::size_t most) override {
    std::string bytes(most, '\0');
    const ssize_t count = ::pread(file_.get(), bytes.data(), most, static_cast<off_t>(offset));
    if (count <= 0) {
      throw QueueError("a result cannot be read");
    }
    bytes.resize(static_cast<std::size_t>(count));
    return bytes;
  }

 private:
  Descriptor file_;
  std::uint64_t size_;
};

}  // namespace

class SqliteQueue::Connection final : public SqlConnection {
 public:
  explicit Connection(const std::filesystem::path& file) {
    sqlite3* database = nullptr;
    const int result =
        sqlite3_open_v2(file.c_str(), &database, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, nullptr);
    database_.reset(database);
    if (result != SQLITE_OK) {
      throw QueueError("cannot open " + file.string() + ": " + sqlite3_errstr(result));
    }
    sqlite3_busy_timeout(database, kLockMilliseconds);
  }

  SqlResult Run(const std::string& sql, const std::vector<SqlValue>& values = {}) override {
    sqlite3_stmt* prepared = nullptr;
    Check(sqlite3_prepare_v2(database_.get(), sql.c_str(), -1, &prepared, nullptr));
    const std::unique_ptr<sqlite3_stmt, Finalizer> statement(prepared);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const int index = sqlite3_bind_parameter_index(prepared, ("$" + std::to_string(i + 1)).c_str());
      std::visit([&](const auto& value) { Check(Bind(prepared, index, value)); }, values[i]);
    }
    SqlResult result;
    int step = sqlite3_step(prepared);
    for (; step == SQLITE_ROW; step = sqlite3_step(prepared)) {
      auto& row = result.rows.emplace_back();
      for (int column = 0; column < sqlite3_column_count(prepared); ++column) {
        const unsigned char* text = sqlite3_column_text(prepared, column);
        row.push_back(text == nullptr ? std::nullopt
                                      : std::optional<std::string>(reinterpret_cast<const char*>(text)));
      }
    }
    Check(step == SQLITE_DONE ? SQLITE_OK : step);
    result.changed = static_cast<std::size_t>(sqlite3_changes(database_.get()));
    return result;
  }

  /// Runs any number of statements.
  void Execute(const char* sql) { Check(sqlite3_exec(database_.get(), sql, nullptr, nullptr, nullptr)); }

  void Transact(const std::function<void(SqlConnection&)>& work) {
    Execute("BEGIN IMMEDIATE");
    try {
      work(*this);
      Execute("COMMIT");
    } catch (...) {
      sqlite3_exec(database_.get(), "ROLLBACK", nullptr, nullptr, nullptr);
      throw;
    }
  }

 private:
  struct Closer {
    void operator()(sqlite3* database) const { sqlite3_close(database); }
  };
  struct Finalizer {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };

  static int Bind(sqlite3_stmt* statement, int index, std::nullptr_t) {
    return sqlite3_bind_null(statement, index);
  }
  static int Bind(sqlite3_stmt* statement, int index, std::int64_t number) {
    return sqlite3_bind_int64(statement, index, number);
  }
  static int Bind(sqlite3_stmt* statement, int index, double number) {
    return sqlite3_bind_double(statement, index, number);
  }
  static int Bind(sqlite3_stmt* statement, int index, const std::string& text) {
    return sqlite3_bind_text64(statement, index, text.data(), text.size(), SQLITE_TRANSIENT, SQLITE_UTF8);
  }
  void Check(int result) const {
    if (result != SQLITE_OK) {
      throw QueueError(std::string("the queue: ") + sqlite3_errmsg(database_.get()));
    }
  }

  std::unique_ptr<sqlite3, Closer> database_;
};

SqliteQueue::SqliteQueue(const std::filesystem::path& data, std::chrono::milliseconds keep)
    : SqlQueue(kSqliteNow, keep), jobs_(data / "jobs") {
  OnDisk([&] { std::filesystem::create_directories(jobs_); });
  const std::filesystem::path file = data / "jobs.sqlite";
  writer_ = std::make_unique<Connection>(file);
  writer_->Execute("PRAGMA journal_mode = WAL");
  writer_->Execute("PRAGMA synchronous = FULL");
  writer_->Execute("PRAGMA foreign_keys = ON");
  writer_->Transact([&](SqlConnection& connection) {
    const std::string found = connection.Run("PRAGMA user_version").rows.at(0).at(0).value_or("");
    if (found != "0" && found != "1" && found != "2" && found != std::to_string(kSqliteSchemaVersion)) {
      throw QueueError(file.string() + " is of version " + found + ", this radbaked knows " +
                       std::to_string(kSqliteSchemaVersion));
    }
    if (found == "1") {
      writer_->Execute(kSchemaFrom1);
    }
    if (found == "1" || found == "2") {
      writer_->Execute(kSchemaFrom2);
    }
    writer_->Execute(kSchema);
    connection.Run("PRAGMA user_version = " + std::to_string(kSqliteSchemaVersion));
  });
  reader_ = std::make_unique<Connection>(file);
}

SqliteQueue::~SqliteQueue() = default;

void SqliteQueue::Transact(const std::function<void(SqlConnection&)>& work) {
  const std::lock_guard lock(write_mutex_);
  writer_->Transact(work);
}

SqlResult SqliteQueue::Read(const std::string& sql, const std::vector<SqlValue>& values) {
  const std::lock_guard lock(read_mutex_);
  return reader_->Run(sql, values);
}

SqlResult SqliteQueue::Write(const std::string& sql, const std::vector<SqlValue>& values) {
  const std::lock_guard lock(write_mutex_);
  return writer_->Run(sql, values);
}

void SqliteQueue::OnChange(std::function<void()> hint) {
  const std::lock_guard lock(hint_mutex_);
  hint_ = std::move(hint);
}

void SqliteQueue::Hint() {
  const std::lock_guard lock(hint_mutex_);
  if (hint_) {
    hint_();
  }
}

Added SqliteQueue::Add(const NewJob& job, const std::filesystem::path& folder) {
  OnDisk([&] {
    SyncTree(folder);
    SyncFolder(folder.parent_path());
  });
  return AddWith(job, [](SqlConnection&) {});
}

bool SqliteQueue::KeepsFolder(const std::string& id) {
  return Find(id).has_value();
}

std::optional<Job> SqliteQueue::Claim(const std::string& worker) {
  std::optional<Job> job;
  Transact([&](SqlConnection& connection) {
    job = ReadOne(connection.Run(
        "UPDATE jobs SET status = 'running', worker = $1, attempt = attempt + 1, started = max(" + now() +
            R"(, created), progress = 0, told = '{}'
             WHERE sequence = (
               SELECT min(sequence) FROM jobs AS job LEFT JOIN turns USING (owner) WHERE status = 'queued'
               GROUP BY owner
               ORDER BY (SELECT count(*) FROM jobs WHERE status = 'running' AND owner = job.owner),
                        coalesce(taken, 0), min(sequence)
               LIMIT 1)
             RETURNING )" +
            kColumns,
        {worker}));
    if (job) {
      connection.Run(
          "INSERT INTO turns (owner, taken) SELECT $1, coalesce(max(taken), 0) + 1 FROM turns WHERE true"
          " ON CONFLICT (owner) DO UPDATE SET taken = excluded.taken",
          {job->owner});
    }
  });
  return job;
}

void SqliteQueue::Fetch(const std::string& id, const std::filesystem::path& folder) {
  std::filesystem::copy(
      Folder(id), folder,
      std::filesystem::copy_options::recursive | std::filesystem::copy_options::create_hard_links);
}

// The files go to their places while the row is changed but not committed: nobody else can take the job
// meanwhile. Where the commit fails, this is asked for again, and finds them moved.
bool SqliteQueue::Finish(const Attempt& attempt, const Outcome& outcome,
                         const std::filesystem::path& results) {
  std::vector<const char*> names;
  if (outcome.status == Status::kSucceeded) {
    names = {kStatisticsFile, kBakedFile};
    std::erase_if(names, [&](const char* name) { return !std::filesystem::exists(results / name); });
  }
  return OnDisk([&] {
    for (const char* name : names) {
      SyncFile(results / name);
    }
    return FinishWith(attempt, outcome, [&](SqlConnection&) {
      for (const char* name : names) {
        std::filesystem::rename(results / name, Folder(attempt.id) / name);
      }
      SyncFolder(Folder(attempt.id));
    });
  });
}

bool SqliteQueue::Remove(const std::string& id) {
  const bool removed = SqlQueue::Remove(id);
  if (removed) {
    std::error_code ignored;  // the next start removes what is left
    std::filesystem::remove_all(Folder(id), ignored);
  }
  return removed;
}

std::vector<std::string> SqliteQueue::Forget(std::chrono::milliseconds ahead) {
  std::vector<std::string> ids = SqlQueue::Forget(ahead);
  for (const std::string& id : ids) {
    std::error_code ignored;  // as above
    std::filesystem::remove_all(Folder(id), ignored);
  }
  return ids;
}

std::unique_ptr<StoredFile> SqliteQueue::Open(const std::string& id, const std::string& name) {
  Descriptor file(::open((Folder(id) / name).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  struct stat status{};
  if (!file.open() || ::fstat(file.get(), &status) != 0 || status.st_size == 0) {
    return nullptr;
  }
  return std::make_unique<FileOnDisk>(std::move(file), static_cast<std::uint64_t>(status.st_size));
}

}  // namespace radbake::server
