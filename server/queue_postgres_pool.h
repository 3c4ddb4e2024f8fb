/// Connections to PostgreSQL: made when they are needed, kept for the next who needs one, and made anew when
/// the database has gone and come back.
///
/// While it is away (it refuses connections, or has not answered in time) one caller at a time finds out
/// whether it is there again, and all others are refused at once: so a database that hangs does not hold up
/// whoever asks for it.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "server/files.h"
#include "server/queue_postgres_connection.h"

namespace radbake::server {

/// Thread-safe.
class PostgresPool {
 public:
  static constexpr std::size_t kConnections = 8;

  /// `prepare` is run once, on the first connection. `patience`: as PostgresConnection's, and how long a
  /// caller waits for a connection that others use. Throws QueueError for a URL that is none.
  PostgresPool(const std::string& url, std::chrono::seconds patience,
               std::function<void(PostgresConnection&)> prepare);

  /// Runs `work` with a connection that nobody else uses meanwhile. Throws QueueError where there is none to
  /// be had.
  void With(const std::function<void(PostgresConnection&)>& work);
  /// One more connection, to keep.
  std::unique_ptr<PostgresConnection> Connect();

 private:
  enum class Turn { kOneOfMany, kForAll };

  /// Throws where the database is away, unless it is time for one to try again.
  Turn Ask();
  void SetAway(const std::string& why);
  void SetThere();
  std::unique_ptr<PostgresConnection> Take();
  void Put(std::unique_ptr<PostgresConnection> connection);

  std::string url_;
  std::chrono::seconds patience_;
  std::function<void(PostgresConnection&)> prepare_;
  std::mutex prepare_mutex_;
  std::atomic<bool> prepared_ = false;

  std::mutex mutex_;
  std::condition_variable put_;
  std::size_t taken_ = 0;
  std::vector<std::unique_ptr<PostgresConnection>> idle_;
  bool away_ = false;                              ///< as far as is known
  bool asked_ = false;                             ///< one tries whether it still is
  std::chrono::steady_clock::time_point refused_;  ///< when the last attempt has failed
  std::string refusal_;                            ///< why
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
