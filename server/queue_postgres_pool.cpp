#include "server/queue_postgres_pool.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cstdint>
#include <utility>

namespace radbake::server {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto kAfterRefusal = 250ms;  // in which nobody asks the database again
constexpr auto kListenPause = 1s;
constexpr auto kListenTurn = 10s;

}  // namespace

PostgresPool::PostgresPool(const std::string& url, std::chrono::seconds patience,
                           std::function<void(PostgresConnection&)> prepare)
    : url_(url), patience_(patience), prepare_(std::move(prepare)) {
  CheckPostgresUrl(url);
}

PostgresPool::Turn PostgresPool::Ask() {
  const std::lock_guard lock(mutex_);
  if (!away_) {
    return Turn::kOneOfMany;
  }
  if (asked_ || Clock::now() - refused_ < kAfterRefusal) {
    throw QueueError(refusal_);
  }
  asked_ = true;
  return Turn::kForAll;
}

void PostgresPool::SetAway(const std::string& why) {
  {
    const std::lock_guard lock(mutex_);
    away_ = true;
    asked_ = false;
    refused_ = Clock::now();
    refusal_ = why;
    idle_.clear();
  }
  put_.notify_all();
}

void PostgresPool::SetThere() {
  const std::lock_guard lock(mutex_);
  away_ = false;
  asked_ = false;
}

std::unique_ptr<PostgresConnection> PostgresPool::Connect() {
  const Turn turn = Ask();
  std::unique_lock preparing(prepare_mutex_, std::defer_lock);
  if (!prepared_) {
    preparing.lock();
    if (turn == Turn::kOneOfMany) {
      Ask();  // another may have been refused meanwhile
    }
  }
  try {
    auto connection = std::make_unique<PostgresConnection>(url_, patience_);
    if (!prepared_) {
      prepare_(*connection);
      prepared_ = true;
    }
    SetThere();
    return connection;
  } catch (const std::exception& error) {
    SetAway(error.what());
    throw;
  }
}

std::unique_ptr<PostgresConnection> PostgresPool::Take() {
  std::unique_lock lock(mutex_);
  put_.wait_for(lock, patience_, [&] { return taken_ < kConnections || away_; });
  if (taken_ >= kConnections) {
    throw QueueError(away_ ? refusal_ : "the database: all connections are in use");
  }
  ++taken_;
  while (!idle_.empty()) {
    std::unique_ptr<PostgresConnection> connection = std::move(idle_.back());
    idle_.pop_back();
    if (connection->Alive()) {
      return connection;
    }
  }
  return nullptr;
}

void PostgresPool::Put(std::unique_ptr<PostgresConnection> connection) {
  {
    const std::lock_guard lock(mutex_);
    --taken_;
    if (connection != nullptr && connection->Alive()) {
      idle_.push_back(std::move(connection));
    }
  }
  put_.notify_one();
}

void PostgresPool::With(const std::function<void(PostgresConnection&)>& work) {
  std::unique_ptr<PostgresConnection> connection = Take();
  try {
    if (connection == nullptr) {
      connection = Connect();
    }
    work(*connection);
  } catch (const DatabaseSilent& error) {
    SetAway(error.what());
    Put(nullptr);
    throw;
  } catch (...) {
    Put(std::move(connection));
    throw;
  }
  Put(std::move(connection));
}

PostgresListener::PostgresListener(PostgresPool& pool, std::function<void()> hint)
    : pool_(pool), hint_(std::move(hint)), stop_(::eventfd(0, EFD_CLOEXEC)) {
  thread_ = std::thread([this] { Listen(); });
}

PostgresListener::~PostgresListener() {
  const std::uint64_t one = 1;
  static_cast<void>(!::write(stop_.get(), &one, sizeof one));
  thread_.join();
}

void PostgresListener::Listen() {
  std::unique_ptr<PostgresConnection> connection;
  const auto stopped = [&](std::chrono::milliseconds most) {
    pollfd event{stop_.get(), POLLIN, 0};
    return ::poll(&event, 1, static_cast<int>(most.count())) > 0;
  };
  while (!stopped(0ms)) {
    try {
      if (connection == nullptr) {
        connection = pool_.Connect();
        connection->Execute("LISTEN radbake");
        hint_();  // whatever was missed
      }
      if (connection->WaitForNotice(stop_, kListenTurn)) {
        hint_();
      }
    } catch (const std::exception&) {
      connection.reset();  // others say what is wrong
      if (stopped(kListenPause)) {
        return;
      }
    }
  }
}

}  // namespace radbake::server
