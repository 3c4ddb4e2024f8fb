#include "server/queue_postgres.h"

#include <cstdio>
#include <fstream>
#include <utility>

#include "schema_postgres.sql.h"
#include "server/files.h"

namespace radbake::server {
namespace {

constexpr int kPostgresSchemaVersion = 1;
constexpr int kUpload = 0;  // the attempt that an upload counts as
// A result goes over in transactions of so many pieces, lest who deletes the job has to wait for all of it.
constexpr int kPiecesAtOnce = 16;

const char* const kPostgresNow = "(extract(epoch FROM clock_timestamp()) * 1000)::bigint";

void Prepare(PostgresConnection& connection) {
  connection.Transact([](SqlConnection& transaction) {
    auto& session = static_cast<PostgresConnection&>(transaction);
    session.Run("SELECT pg_advisory_xact_lock(hashtext('radbake'))");  // one instance after the other
    if (session.Run("SELECT 1 FROM pg_tables WHERE schemaname = 'radbake' AND tablename = 'version'")
            .rows.empty()) {
      session.Execute("CREATE SCHEMA IF NOT EXISTS radbake");
      session.Execute(kSchemaPostgres);
    }
    const std::string found = session.Run("SELECT number FROM version").rows.at(0).at(0).value_or("");
    if (found != std::to_string(kPostgresSchemaVersion)) {
      throw QueueError("the database's queue is of version " + found + ", this radbaked knows " +
                       std::to_string(kPostgresSchemaVersion));
    }
  });
}

std::ifstream OpenToRead(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    throw std::filesystem::filesystem_error("cannot open", path, std::make_error_code(std::errc::io_error));
  }
  return file;
}

// One piece after the other, each with its number.
void ForEachPiece(const std::filesystem::path& path,
                  const std::function<void(int number, std::string_view bytes)>& take) {
  std::ifstream file = OpenToRead(path);
  std::string piece(PostgresQueue::kPiece, '\0');
  for (int number = 0;; ++number) {
    file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    const auto count = static_cast<std::size_t>(file.gcount());
    if (file.bad()) {
      throw std::filesystem::filesystem_error("cannot read", path, std::make_error_code(std::errc::io_error));
    }
    if (count > 0 || number == 0) {
      take(number, std::string_view(piece).substr(0, count));
    }
    if (count < piece.size()) {
      return;
    }
  }
}

void StorePiece(PostgresConnection& connection, const Attempt& attempt, const std::string& name, int number,
                std::string_view bytes) {
  connection.RunWithBytes(
      "INSERT INTO pieces (job, attempt, name, number, bytes) VALUES ($1, $2, $3, $4, $5)"
      " ON CONFLICT (job, attempt, name, number) DO UPDATE SET bytes = excluded.bytes",
      {attempt.id, static_cast<std::int64_t>(attempt.number), name, static_cast<std::int64_t>(number)},
      bytes);
}

class FileInPieces final : public StoredFile {
 public:
  FileInPieces(PostgresPool& pool, Attempt attempt, std::string name, std::uint64_t size)
      : pool_(pool), attempt_(std::move(attempt)), name_(std::move(name)), size_(size) {}

  std::uint64_t size() const override { return size_; }

  std::string Read(std::uint64_t offset, std::size_t most) override {
    const std::uint64_t number = offset / PostgresQueue::kPiece;
    if (number != number_) {
      std::optional<std::string> bytes;
      pool_.With([&](PostgresConnection& connection) {
        bytes = connection.ReadBytes(
            "SELECT bytes FROM pieces WHERE job = $1 AND attempt = $2 AND name = $3 AND number = $4",
            {attempt_.id, static_cast<std::int64_t>(attempt_.number), name_,
             static_cast<std::int64_t>(number)});
      });
      if (!bytes) {
        throw QueueError("a result is no longer there");
      }
      piece_ = std::move(*bytes);
      number_ = number;
    }
    const std::string bytes = piece_.substr(static_cast<std::size_t>(offset % PostgresQueue::kPiece), most);
    if (bytes.empty()) {
      throw QueueError("a result has a piece that is too short");
    }
    return bytes;
  }

 private:
  PostgresPool& pool_;
  Attempt attempt_;
  std::string name_;
  std::uint64_t size_;
  std::optional<std::uint64_t> number_;
  std::string piece_;
};

}  // namespace

PostgresQueue::PostgresQueue(const std::string& url, std::chrono::milliseconds keep,
                             std::chrono::seconds patience)
    : SqlQueue(kPostgresNow, keep), pool_(url, patience, Prepare) {}

PostgresQueue::~PostgresQueue() = default;

void PostgresQueue::Transact(const std::function<void(SqlConnection&)>& work) {
  pool_.With([&](PostgresConnection& connection) { connection.Transact(work); });
}

SqlResult PostgresQueue::Read(const std::string& sql, const std::vector<SqlValue>& values) {
  SqlResult result;
  pool_.With([&](PostgresConnection& connection) { result = connection.Run(sql, values); });
  return result;
}

SqlResult PostgresQueue::Write(const std::string& sql, const std::vector<SqlValue>& values) {
  return Read(sql, values);
}

void PostgresQueue::OnChange(std::function<void()> hint) {
  listener_.reset();
  if (hint) {
    listener_ = std::make_unique<PostgresListener>(pool_, std::move(hint));
  }
}

void PostgresQueue::Hint() {
  try {
    Write("NOTIFY radbake", {});
  } catch (const QueueError&) {  // NOLINT(bugprone-empty-catch): without a hint it is found a little later
  }
}

Added PostgresQueue::Add(const NewJob& job, const std::filesystem::path& folder) {
  Added added = AddWith(job, [&](SqlConnection& connection) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
      if (entry.is_regular_file()) {
        const std::string name = entry.path().lexically_relative(folder).generic_string();
        ForEachPiece(entry.path(), [&](int number, std::string_view bytes) {
          StorePiece(static_cast<PostgresConnection&>(connection), {job.id, kUpload}, name, number, bytes);
        });
      }
    }
  });
  if (added.kind == Added::Kind::kNew) {
    std::error_code ignored;  // the next start removes what is left
    std::filesystem::remove_all(folder, ignored);
  }
  return added;
}

bool PostgresQueue::KeepsFolder(const std::string&) {
  return false;
}

std::optional<Job> PostgresQueue::Claim(const std::string& worker) {
  return ReadOne(
      Write("WITH busy AS (SELECT owner, count(*) AS jobs FROM jobs WHERE status = 'running' GROUP BY owner),"
            R"( next AS (
            SELECT job.sequence FROM jobs AS job LEFT JOIN turns USING (owner) LEFT JOIN busy USING (owner)
            WHERE job.status = 'queued'
            ORDER BY coalesce(busy.jobs, 0), coalesce(turns.taken, 0), job.sequence
            LIMIT 1 FOR UPDATE OF job SKIP LOCKED),
          claimed AS (
            UPDATE jobs SET status = 'running', worker = $1, attempt = attempt + 1, progress = 0, told = '{}',
                            started = greatest(created, )" +
                now() +
                R"()
            WHERE sequence = (SELECT sequence FROM next) RETURNING *),
          turn AS (
            INSERT INTO turns (owner, taken) SELECT owner, nextval('takings') FROM claimed
            ON CONFLICT (owner) DO UPDATE SET taken = excluded.taken)
          SELECT )" +
                kColumns + " FROM claimed",
            {worker}));
}

void PostgresQueue::Fetch(const std::string& id, const std::filesystem::path& folder) {
  const SqlResult names =
      Read("SELECT name, max(number) FROM pieces WHERE job = $1 AND attempt = 0 GROUP BY name", {id});
  if (names.rows.empty()) {
    throw std::filesystem::filesystem_error("the upload is not in the database", folder,
                                            std::make_error_code(std::errc::no_such_file_or_directory));
  }
  std::filesystem::create_directory(folder);
  for (const auto& row : names.rows) {
    const std::filesystem::path path = folder / row.at(0).value_or("");
    std::filesystem::create_directories(path.parent_path());
    NewFile file(path.string() + ".part");
    const std::int64_t last = std::stoll(row.at(1).value_or("0"));
    for (std::int64_t number = 0; number <= last; ++number) {
      std::optional<std::string> bytes;
      pool_.With([&](PostgresConnection& connection) {
        bytes = connection.ReadBytes(
            "SELECT bytes FROM pieces WHERE job = $1 AND attempt = 0 AND name = $2 AND number = $3",
            {id, row.at(0).value_or(""), number});
      });
      if (!bytes) {
        throw QueueError("the upload of job " + id + " has been deleted");
      }
      file.Append(*bytes);
    }
    file.Publish(path);
  }
}

// The files go first; without the row that names their attempt they are nobody's, and go with the job.
bool PostgresQueue::Finish(const Attempt& attempt, const Outcome& outcome,
                           const std::filesystem::path& results) {
  if (outcome.status == Status::kSucceeded) {
    const SqlResult held = Read("SELECT 1 FROM jobs WHERE id = $1 AND attempt = $2 AND status = 'running'",
                                {attempt.id, static_cast<std::int64_t>(attempt.number)});
    if (held.rows.empty()) {
      return false;
    }
    for (const char* name : {kStatisticsFile, kBakedFile}) {
      std::vector<std::pair<int, std::string>> pieces;
      const auto store = [&] {
        Transact([&](SqlConnection& connection) {
          for (const auto& [number, bytes] : pieces) {
            StorePiece(static_cast<PostgresConnection&>(connection), attempt, name, number, bytes);
          }
        });
        pieces.clear();
      };
      ForEachPiece(results / name, [&](int number, std::string_view bytes) {
        pieces.emplace_back(number, bytes);
        if (pieces.size() >= kPiecesAtOnce) {
          store();
        }
      });
      store();
    }
  }
  return FinishWith(attempt, outcome, [&](SqlConnection& connection) {
    connection.Run("DELETE FROM pieces WHERE job = $1 AND attempt NOT IN (0, $2)",
                   {attempt.id, static_cast<std::int64_t>(attempt.number)});
  });
}

std::unique_ptr<StoredFile> PostgresQueue::Open(const std::string& id, const std::string& name) {
  const SqlResult last = Read(
      "SELECT pieces.attempt, number, octet_length(bytes) FROM pieces JOIN jobs ON jobs.id = pieces.job"
      " WHERE job = $1 AND pieces.attempt = jobs.attempt AND name = $2 ORDER BY number DESC LIMIT 1",
      {id, name});
  if (last.rows.empty()) {
    return nullptr;
  }
  const auto integer = [&](std::size_t column) { return std::stoull(last.rows[0].at(column).value_or("0")); };
  const std::uint64_t size = integer(1) * kPiece + integer(2);
  return size == 0
             ? nullptr
             : std::make_unique<FileInPieces>(pool_, Attempt{id, static_cast<int>(integer(0))}, name, size);
}

}  // namespace radbake::server
