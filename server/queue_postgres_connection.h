/// A connection to PostgreSQL on which nothing lasts for ever: each statement has a deadline, whatever has
/// become of the server or of the network between.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/files.h"
#include "server/queue_sql.h"

struct pg_conn;
struct pg_result;

namespace radbake::server {

/// Throws QueueError for a URL (or key=value pairs) that libpq does not take.
void CheckPostgresUrl(const std::string& url);

/// The database has not answered in time. What it was asked for it may still do.
class DatabaseSilent : public QueueError {
 public:
  using QueueError::QueueError;
};

/// Every function throws QueueError.
class PostgresConnection final : public SqlConnection {
 public:
  /// Connects, for which each of the URL's hosts has so long (but two seconds at least), as has each
  /// statement from then on: after that it throws DatabaseSilent, and the connection is closed.
  PostgresConnection(const std::string& url, std::chrono::seconds patience);
  ~PostgresConnection() override;

  SqlResult Run(const std::string& sql, const std::vector<SqlValue>& values = {}) override;
  /// The same with bytes as the parameter after the values.
  void RunWithBytes(const std::string& sql, const std::vector<SqlValue>& values, std::string_view bytes);
  /// A query whose one column of its one row, if there is one, is bytes.
  std::optional<std::string> ReadBytes(const std::string& sql, const std::vector<SqlValue>& values);
  /// Runs any number of statements.
  void Execute(const std::string& sql);
  void Transact(const std::function<void(SqlConnection&)>& work);

  /// False when it is closed, or the database is known to have gone.
  bool Alive();
  /// Waits until something has been notified, the descriptor `stop` is readable, or so much time has passed.
  /// True: something has been.
  bool WaitForNotice(const Descriptor& stop, std::chrono::milliseconds most);

 private:
  using Deadline = std::chrono::steady_clock::time_point;
  struct Closer {
    void operator()(pg_conn* connection) const;
  };
  struct Clearer {
    void operator()(pg_result* result) const;
  };
  using Result = std::unique_ptr<pg_result, Clearer>;

  Result Query(const std::string& sql, const std::vector<SqlValue>& values, const std::string_view* bytes,
               int result_format);
  Result Await(bool sent);
  void Wait(short events, Deadline deadline);
  [[noreturn]] void Fail() const;

  std::chrono::seconds patience_;
  std::unique_ptr<pg_conn, Closer> connection_;  ///< null: closed
};

}  // namespace radbake::server
