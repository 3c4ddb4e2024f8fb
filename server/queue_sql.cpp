#include "server/queue_sql.h"

#include <charconv>
#include <limits>
#include <utility>

namespace radbake::server {
namespace {

std::string Told(const Live& live) {
  return ToText({{"phase", live.phase}, {"statistics", live.statistics}});
}

SqlValue ToValue(const std::optional<Problem>& problem) {
  return problem ? SqlValue(ToText(ToJson(*problem))) : SqlValue(nullptr);
}

SqlValue ToValue(std::chrono::milliseconds time) {
  return static_cast<std::int64_t>(time.count());
}

SqlValue ToValue(int number) {
  return static_cast<std::int64_t>(number);
}

template <typename Number>
Number ParseNumber(std::string_view text) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) {
    throw QueueError("the queue holds " + Quoted(text) + " for a number");
  }
  return number;
}

// The columns of a row, in the order in which they stand.
class Reader {
 public:
  explicit Reader(const std::vector<std::optional<std::string>>& row) : row_(row) {}

  const std::optional<std::string>& Next() { return row_.at(column_++); }
  std::string Text() { return Next().value_or(""); }
  std::int64_t Integer() { return ParseNumber<std::int64_t>(Next().value_or("0")); }
  double Real() { return ParseNumber<double>(Next().value_or("0")); }
  std::optional<Time> TimePoint() {
    const std::optional<std::string>& text = Next();
    return text ? std::optional(Time(std::chrono::milliseconds(ParseNumber<std::int64_t>(*text))))
                : std::nullopt;
  }

 private:
  const std::vector<std::optional<std::string>>& row_;
  std::size_t column_ = 0;
};

Job ReadJob(const std::vector<std::optional<std::string>>& row) {
  Reader reader(row);
  Job job;
  job.sequence = reader.Integer();
  job.id = reader.Text();
  job.owner = reader.Text();
  job.status = StatusFrom(reader.Text()).value_or(job.status);
  job.scene = reader.Text();
  job.attempt = static_cast<int>(reader.Integer());
  job.crashes = static_cast<int>(reader.Integer());
  job.live.progress = reader.Real();
  const nlohmann::json told = nlohmann::json::parse(reader.Text());
  job.live.phase = told.value("phase", "");
  job.live.statistics = told.value("statistics", nlohmann::json::object());
  job.created = reader.TimePoint().value_or(Time());
  job.started = reader.TimePoint();
  job.ended = reader.TimePoint();
  job.expires = reader.TimePoint();
  if (const std::optional<std::string>& problem = reader.Next()) {
    job.problem = ProblemFromJson(nlohmann::json::parse(*problem));
  }
  return job;
}

// The later of the two: no job ends before it has started.
std::string Latest(const std::string& a, const std::string& b) {
  return "CASE WHEN " + a + " > " + b + " THEN " + a + " ELSE " + b + " END";
}

}  // namespace

const std::string SqlQueue::kColumns =
    "sequence, id, owner, status, scene, attempt, crashes, progress, told, created, started, ended, expires,"
    " problem";

std::optional<Job> SqlQueue::ReadOne(const SqlResult& result) {
  return result.rows.empty() ? std::nullopt : std::optional(ReadJob(result.rows.front()));
}

Added SqlQueue::AddWith(const NewJob& job, const std::function<void(SqlConnection&)>& store) {
  Added added;
  // Who comes with the same key at the same moment may be first: then its job is found the second time.
  for (bool done = false; !done;) {
    Transact([&](SqlConnection& connection) {
      done = true;
      if (job.key) {
        const SqlValue life = ToValue(std::chrono::milliseconds(kKeyLife));
        connection.Run("DELETE FROM keys WHERE owner = $1 AND key = $2 AND created <= " + now_ + " - $3",
                       {job.owner, job.key->key, life});
        const SqlResult found = connection.Run("SELECT job, digest FROM keys WHERE owner = $1 AND key = $2",
                                               {job.owner, job.key->key});
        if (!found.rows.empty()) {
          const bool same = found.rows[0].at(1) == job.key->digest;
          added.kind = same ? Added::Kind::kSame : Added::Kind::kOther;
          added.job = ReadOne(connection.Run("SELECT " + kColumns + " FROM jobs WHERE id = $1",
                                             {found.rows[0].at(0).value_or("")}))
                          .value_or(Job());
          return;
        }
      }
      added.job = ReadOne(connection.Run("INSERT INTO jobs (id, owner, status, scene, created) VALUES"
                                         " ($1, $2, 'queued', $3, " +
                                             now_ + ") RETURNING " + kColumns,
                                         {job.id, job.owner, job.scene}))
                      .value();
      if (job.key &&
          connection
                  .Run("INSERT INTO keys (owner, key, digest, job, created) VALUES ($1, $2, $3, $4, " + now_ +
                           ") ON CONFLICT DO NOTHING",
                       {job.owner, job.key->key, job.key->digest, job.id})
                  .changed == 0) {
        connection.Run("DELETE FROM jobs WHERE id = $1", {job.id});
        done = false;
        return;
      }
      store(connection);
    });
  }
  if (added.kind == Added::Kind::kNew) {
    Hint();
  }
  return added;
}

bool SqlQueue::FinishWith(const Attempt& attempt, const Outcome& outcome,
                          const std::function<void(SqlConnection&)>& store) {
  bool finished = false;
  const std::string ended = Latest(now_, "started");
  Transact([&](SqlConnection& connection) {
    finished = connection
                   .Run(
                       "UPDATE jobs SET status = $1, progress = $2, told = $3, problem = $4, worker = NULL,"
                       " ended = " +
                           ended + ", expires = " + ended +
                           " + $5 WHERE id = $6 AND attempt = $7 AND status = 'running'",
                       {std::string(ToString(outcome.status)), outcome.live.progress, Told(outcome.live),
                        ToValue(outcome.problem), ToValue(keep_), attempt.id, ToValue(attempt.number)})
                   .changed > 0;
    if (finished) {
      store(connection);
    }
  });
  return finished;
}

bool SqlQueue::Beat(const Attempt& attempt, const Live& live) {
  return Write(
             "UPDATE jobs SET beats = beats + 1, progress = $1, told = $2"
             " WHERE id = $3 AND attempt = $4 AND status = 'running'",
             {live.progress, Told(live), attempt.id, ToValue(attempt.number)})
             .changed > 0;
}

bool SqlQueue::Release(const Attempt& attempt) {
  const bool released =
      Write(
          "UPDATE jobs SET status = 'queued', worker = NULL, started = NULL, progress = 0, told = '{}'"
          " WHERE id = $1 AND attempt = $2 AND status = 'running'",
          {attempt.id, ToValue(attempt.number)})
          .changed > 0;
  Hint();
  return released;
}

std::size_t SqlQueue::CrashWhere(const std::string& condition, const std::vector<SqlValue>& values,
                                 const Problem& reason) {
  const std::string last = "crashes + 1 >= " + std::to_string(kAttempts);
  const auto either = [&](const std::string& failed, const std::string& queued) {
    return "CASE WHEN " + last + " THEN " + failed + " ELSE " + queued + " END";
  };
  const std::string ended = Latest(now_, "started");
  std::vector<SqlValue> all = {ToValue(std::optional(reason)), ToValue(keep_)};
  all.insert(all.end(), values.begin(), values.end());
  const std::size_t changed =
      Write(
          "UPDATE jobs SET crashes = crashes + 1, worker = NULL, status = " + either("'failed'", "'queued'") +
              ", started = " + either("started", "NULL") + ", progress = " + either("progress", "0") +
              ", told = " + either("told", "'{}'") + ", problem = " + either("$1", "NULL") +
              ", ended = " + either(ended, "NULL") + ", expires = " + either(ended + " + $2", "NULL") +
              " WHERE status = 'running' AND " + condition,
          all)
          .changed;
  if (changed > 0) {
    Hint();
  }
  return changed;
}

bool SqlQueue::Crash(const Attempt& attempt, const Problem& reason) {
  return CrashWhere("id = $3 AND attempt = $4", {attempt.id, ToValue(attempt.number)}, reason) > 0;
}

std::vector<Held> SqlQueue::ListHeld() {
  std::vector<Held> held;
  for (const auto& row :
       Read("SELECT id, attempt, beats, worker FROM jobs WHERE status = 'running'", {}).rows) {
    Reader reader(row);
    Held one;
    one.attempt.id = reader.Text();
    one.attempt.number = static_cast<int>(reader.Integer());
    one.beats = reader.Integer();
    one.worker = reader.Text();
    held.push_back(std::move(one));
  }
  return held;
}

bool SqlQueue::TakeBack(const Held& held, const Problem& reason) {
  return CrashWhere("id = $3 AND attempt = $4 AND beats = $5",
                    {held.attempt.id, ToValue(held.attempt.number), held.beats}, reason) > 0;
}

std::size_t SqlQueue::TakeBackFrom(const std::string& worker, const Problem& reason) {
  return CrashWhere("worker = $3", {worker}, reason);
}

bool SqlQueue::Cancel(const std::string& id, const std::optional<Live>& live) {
  const std::string ended = Latest(now_, "coalesce(started, created)");
  const bool canceled =
      Write(
          "UPDATE jobs SET status = 'canceled', worker = NULL, progress = coalesce($1, progress),"
          " told = coalesce($2, told), ended = " +
              ended + ", expires = " + ended + " + $3 WHERE id = $4 AND status IN ('queued', 'running')",
          {live ? SqlValue(live->progress) : SqlValue(nullptr),
           live ? SqlValue(Told(*live)) : SqlValue(nullptr), ToValue(keep_), id})
          .changed > 0;
  if (canceled) {
    Hint();
  }
  return canceled;
}

bool SqlQueue::Remove(const std::string& id) {
  const bool removed = Write("DELETE FROM jobs WHERE id = $1", {id}).changed > 0;
  if (removed) {
    Hint();
  }
  return removed;
}

std::vector<std::string> SqlQueue::Forget(std::chrono::milliseconds ahead) {
  Write("DELETE FROM keys WHERE created <= " + now_ + " + $1 - $2",
        {ToValue(ahead), ToValue(std::chrono::milliseconds(kKeyLife))});
  const SqlResult gone = Write("DELETE FROM jobs WHERE id IN (SELECT id FROM jobs WHERE expires <= " + now_ +
                                   " + $1 ORDER BY expires LIMIT $2) RETURNING id",
                               {ToValue(ahead), ToValue(kForgottenAtOnce)});
  std::vector<std::string> ids;
  ids.reserve(gone.rows.size());
  for (const auto& row : gone.rows) {
    ids.push_back(row.at(0).value_or(""));
  }
  return ids;
}

std::optional<Job> SqlQueue::Find(const std::string& id) {
  return ReadOne(Read("SELECT " + kColumns + " FROM jobs WHERE id = $1", {id}));
}

std::vector<Job> SqlQueue::List(const Page& page) {
  const SqlResult found = Read(
      "SELECT " + kColumns +
          " FROM jobs WHERE owner = $1 AND sequence < $2 AND ($3 = '' OR status = $3)"
          " ORDER BY sequence DESC LIMIT $4",
      {page.owner,
       page.after.empty() ? std::numeric_limits<std::int64_t>::max() : ParseNumber<std::int64_t>(page.after),
       std::string(page.status ? ToString(*page.status) : ""), static_cast<std::int64_t>(page.limit)});
  std::vector<Job> jobs;
  jobs.reserve(found.rows.size());
  for (const auto& row : found.rows) {
    jobs.push_back(ReadJob(row));
  }
  return jobs;
}

Waiting SqlQueue::CountQueued(const std::string& owner) {
  const SqlResult found =
      Read("SELECT count(*), count(*) FILTER (WHERE owner = $1) FROM jobs WHERE status = 'queued'", {owner});
  Reader reader(found.rows.at(0));
  Waiting waiting;
  waiting.all = static_cast<std::size_t>(reader.Integer());
  waiting.of_owner = static_cast<std::size_t>(reader.Integer());
  return waiting;
}

std::map<Status, std::size_t> SqlQueue::Count() {
  std::map<Status, std::size_t> counts = {{Status::kQueued, 0},
                                          {Status::kRunning, 0},
                                          {Status::kSucceeded, 0},
                                          {Status::kFailed, 0},
                                          {Status::kCanceled, 0}};
  for (const auto& row : Read("SELECT status, count(*) FROM jobs GROUP BY status", {}).rows) {
    Reader reader(row);
    const std::optional<Status> status = StatusFrom(reader.Text());
    counts[status.value_or(Status::kQueued)] = static_cast<std::size_t>(reader.Integer());
  }
  return counts;
}

}  // namespace radbake::server
