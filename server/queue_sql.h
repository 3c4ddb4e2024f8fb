/// What the queues of both databases share: their statements, in the SQL that both speak.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "server/queue.h"

namespace radbake::server {

/// What stands for $1, $2, … in a statement.
using SqlValue = std::variant<std::nullptr_t, std::int64_t, double, std::string>;

struct SqlResult {
  std::vector<std::vector<std::optional<std::string>>> rows;  ///< as text; nothing: NULL
  std::size_t changed = 0;                                    ///< rows, where the statement is no query
};

/// A connection to the database, for one thread at a time.
class SqlConnection {
 public:
  SqlConnection() = default;
  SqlConnection(const SqlConnection&) = delete;
  SqlConnection& operator=(const SqlConnection&) = delete;
  virtual ~SqlConnection() = default;
  /// Runs one statement. Throws QueueError.
  virtual SqlResult Run(const std::string& sql, const std::vector<SqlValue>& values = {}) = 0;
};

class SqlQueue : public Queue {
 public:
  bool Beat(const Attempt& attempt, const Live& live) override;
  bool Release(const Attempt& attempt) override;
  bool Crash(const Attempt& attempt, const Problem& reason) override;
  std::vector<Held> ListHeld() override;
  bool TakeBack(const Held& held, const Problem& reason) override;
  std::size_t TakeBackFrom(const std::string& worker, const Problem& reason) override;
  bool Cancel(const std::string& id, const std::optional<Live>& live) override;
  bool Remove(const std::string& id) override;
  std::vector<std::string> Forget(std::chrono::milliseconds ahead) override;
  std::optional<Job> Find(const std::string& id) override;
  std::vector<Job> List(const Page& page) override;
  Waiting CountQueued(const std::string& owner) override;
  std::map<Status, std::size_t> Count() override;

 protected:
  /// The columns of a job, for Read…().
  static const std::string kColumns;

  /// `now`: an expression of the database's for the milliseconds since 1970. Jobs are forgotten so long after
  /// their end.
  SqlQueue(std::string now, std::chrono::milliseconds keep) : now_(std::move(now)), keep_(keep) {}

  /// Runs `work` in one transaction, which is undone if it throws.
  virtual void Transact(const std::function<void(SqlConnection&)>& work) = 0;
  /// Runs one statement that changes nothing.
  virtual SqlResult Read(const std::string& sql, const std::vector<SqlValue>& values) = 0;
  /// Runs one statement that changes something.
  virtual SqlResult Write(const std::string& sql, const std::vector<SqlValue>& values) = 0;
  /// Add(), whose files `store` stores in the same transaction.
  Added AddWith(const NewJob& job, const std::function<void(SqlConnection&)>& store);
  /// Finish(), likewise.
  bool FinishWith(const Attempt& attempt, const Outcome& outcome,
                  const std::function<void(SqlConnection&)>& store);
  /// There may be something to claim, or something held was canceled.
  virtual void Hint() = 0;

  const std::string& now() const { return now_; }
  static std::optional<Job> ReadOne(const SqlResult& result);

 private:
  std::size_t CrashWhere(const std::string& condition, const std::vector<SqlValue>& values,
                         const Problem& reason);

  std::string now_;
  std::chrono::milliseconds keep_;
};

}  // namespace radbake::server
