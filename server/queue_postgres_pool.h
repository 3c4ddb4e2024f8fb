/// Connections to PostgreSQL: made when they are needed, kept for the next who needs one, and made anew when
/// the database has gone and come back.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "server/files.h"
#include "server/queue_sql.h"

struct pg_conn;
struct pg_result;

namespace radbake::server {

class PostgresConnection final : public SqlConnection {
 public:
  /// Connects, within seconds. Throws QueueError where it cannot.
  explicit PostgresConnection(const std::string& url);
  ~PostgresConnection() override;

  SqlResult Run(const std::string& sql, const std::vector<SqlValue>& values = {}) override;
  /// The same with bytes as the parameter after the values.
  void RunWithBytes(const std::string& sql, const std::vector<SqlValue>& values, std::string_view bytes);
  /// A query whose one column of its one row, if there is one, is bytes.
  std::optional<std::string> ReadBytes(const std::string& sql, const std::vector<SqlValue>& values);
  /// Runs any number of statements.
  void Execute(const std::string& sql);
  void Transact(const std::function<void(SqlConnection&)>& work);

  /// False when the database is known to have gone.
  bool Alive();
  /// Waits until something has been notified, the descriptor `stop` is readable, or so much time has passed.
  /// True: something has been.
  bool WaitForNotice(const Descriptor& stop, std::chrono::milliseconds most);

 private:
  struct Closer {
    void operator()(pg_conn* connection) const;
  };
  struct Clearer {
    void operator()(pg_result* result) const;
  };
  using Result = std::unique_ptr<pg_result, Clearer>;

  Result Query(const std::string& sql, const std::vector<SqlValue>& values, const std::string_view* bytes,
               int result_format);
  void Check(const Result& result) const;
  [[noreturn]] void Fail() const;

  std::unique_ptr<pg_conn, Closer> connection_;
};

/// Thread-safe.
class PostgresPool {
 public:
  static constexpr std::size_t kConnections = 8;

  /// `prepare` is run once, on the first connection. Throws QueueError for a URL that is none.
  PostgresPool(const std::string& url, std::function<void(PostgresConnection&)> prepare);

  /// Runs `work` with a connection that nobody else uses meanwhile. Throws QueueError where there is none to
  /// be had.
  void With(const std::function<void(PostgresConnection&)>& work);
  /// One more connection, to keep.
  std::unique_ptr<PostgresConnection> Connect();

 private:
  std::unique_ptr<PostgresConnection> Take();
  void Put(std::unique_ptr<PostgresConnection> connection);

  std::string url_;
  std::function<void(PostgresConnection&)> prepare_;
  std::mutex prepare_mutex_;
  bool prepared_ = false;

  std::mutex mutex_;
  std::condition_variable put_;
  std::size_t taken_ = 0;
  std::vector<std::unique_ptr<PostgresConnection>> idle_;
  std::chrono::steady_clock::time_point refused_;  ///< when the last attempt to connect has failed
  std::string refusal_;
};

/// A thread that listens for notices, and calls the hint for each that may have come.
class PostgresListener {
 public:
  PostgresListener(PostgresPool& pool, std::function<void()> hint);
  ~PostgresListener();
  PostgresListener(const PostgresListener&) = delete;
  PostgresListener& operator=(const PostgresListener&) = delete;

 private:
  void Listen();

  PostgresPool& pool_;
  std::function<void()> hint_;
  Descriptor stop_;
  std::thread thread_;
};

}  // namespace radbake::server
