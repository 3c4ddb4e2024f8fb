#include "server/queue_postgres_pool.h"

#include <libpq-fe.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <utility>

namespace radbake::server {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto kWaitForConnection = 10s;  // that callers wait for a connection that others use
constexpr auto kAfterRefusal = 250ms;     // in which nobody else tries to connect
constexpr auto kListenPause = 1s;
constexpr auto kListenTurn = 10s;

// A database that has gone without a word is found out within seconds. What the URL says goes before.
constexpr std::array<std::pair<const char*, const char*>, 6> kDefaults = {{{"connect_timeout", "5"},
                                                                           {"keepalives_idle", "5"},
                                                                           {"keepalives_interval", "2"},
                                                                           {"keepalives_count", "3"},
                                                                           {"tcp_user_timeout", "15000"},
                                                                           {"application_name", "radbaked"}}};

// Nor does the database wait long for a client that has gone.
const char* const kSession =
    "SET search_path TO radbake; SET statement_timeout TO '60s'; SET standard_conforming_strings TO on;"
    "SET idle_in_transaction_session_timeout TO '60s'; SET client_min_messages TO warning";

struct OptionsFreer {
  void operator()(PQconninfoOption* options) const { PQconninfoFree(options); }
};

std::string Message(const char* message) {
  std::string text(message == nullptr ? "" : message);
  text.erase(text.find_last_not_of(" \n\t") + 1);
  return text;
}

// The URL's settings, and ours where it has none.
std::vector<std::pair<std::string, std::string>> Settings(const std::string& url) {
  char* error = nullptr;
  const std::unique_ptr<PQconninfoOption, OptionsFreer> options(PQconninfoParse(url.c_str(), &error));
  if (options == nullptr) {
    const std::string why = Message(error);
    PQfreemem(error);
    throw QueueError("the database's URL: " + why);
  }
  std::vector<std::pair<std::string, std::string>> settings(kDefaults.begin(), kDefaults.end());
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option) {
    if (option->val != nullptr) {
      std::erase_if(settings, [&](const auto& setting) { return setting.first == option->keyword; });
      settings.emplace_back(option->keyword, option->val);
    }
  }
  return settings;
}

std::string AsSent(const SqlValue& value) {
  if (const auto* number = std::get_if<std::int64_t>(&value)) {
    return std::to_string(*number);
  }
  if (const auto* number = std::get_if<double>(&value)) {
    return nlohmann::json(*number).dump();  // the shortest text that is this number
  }
  return std::get<std::string>(value);
}

}  // namespace

void PostgresConnection::Closer::operator()(pg_conn* connection) const {
  PQfinish(connection);
}

void PostgresConnection::Clearer::operator()(pg_result* result) const {
  PQclear(result);
}

PostgresConnection::PostgresConnection(const std::string& url) {
  const auto settings = Settings(url);
  std::vector<const char*> keywords;
  std::vector<const char*> values;
  for (const auto& [keyword, value] : settings) {
    keywords.push_back(keyword.c_str());
    values.push_back(value.c_str());
  }
  keywords.push_back(nullptr);
  values.push_back(nullptr);
  connection_.reset(PQconnectdbParams(keywords.data(), values.data(), 0));
  if (connection_ == nullptr || PQstatus(connection_.get()) != CONNECTION_OK) {
    Fail();
  }
  PQsetNoticeProcessor(
      connection_.get(),
      [](void*, const char* message) { spdlog::warn("the database: {}", Message(message)); }, nullptr);
  Execute(kSession);
}

PostgresConnection::~PostgresConnection() = default;

void PostgresConnection::Fail() const {
  throw QueueError("the database: " + Message(PQerrorMessage(connection_.get())));
}

void PostgresConnection::Check(const Result& result) const {
  const ExecStatusType status = PQresultStatus(result.get());
  if (status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK) {
    Fail();
  }
}

PostgresConnection::Result PostgresConnection::Query(const std::string& sql,
                                                     const std::vector<SqlValue>& values,
                                                     const std::string_view* bytes, int result_format) {
  std::vector<std::string> texts;
  texts.reserve(values.size());
  std::vector<const char*> pointers;
  for (const SqlValue& value : values) {
    const bool null = std::holds_alternative<std::nullptr_t>(value);
    pointers.push_back(null ? nullptr : texts.emplace_back(AsSent(value)).c_str());
  }
  std::vector<int> lengths(values.size(), 0);
  std::vector<int> formats(values.size(), 0);
  if (bytes != nullptr) {
    pointers.push_back(bytes->data());
    lengths.push_back(static_cast<int>(bytes->size()));
    formats.push_back(1);
  }
  Result result(PQexecParams(connection_.get(), sql.c_str(), static_cast<int>(pointers.size()), nullptr,
                             pointers.data(), lengths.data(), formats.data(), result_format));
  Check(result);
  return result;
}

SqlResult PostgresConnection::Run(const std::string& sql, const std::vector<SqlValue>& values) {
  const Result result = Query(sql, values, nullptr, 0);
  SqlResult all;
  all.changed = static_cast<std::size_t>(std::strtoull(PQcmdTuples(result.get()), nullptr, 10));
  for (int row = 0; row < PQntuples(result.get()); ++row) {
    auto& fields = all.rows.emplace_back();
    for (int column = 0; column < PQnfields(result.get()); ++column) {
      const bool null = PQgetisnull(result.get(), row, column) != 0;
      fields.push_back(null ? std::nullopt
                            : std::optional<std::string>(PQgetvalue(result.get(), row, column)));
    }
  }
  return all;
}

void PostgresConnection::RunWithBytes(const std::string& sql, const std::vector<SqlValue>& values,
                                      std::string_view bytes) {
  Query(sql, values, &bytes, 0);
}

std::optional<std::string> PostgresConnection::ReadBytes(const std::string& sql,
                                                         const std::vector<SqlValue>& values) {
  const Result result = Query(sql, values, nullptr, 1);
  if (PQntuples(result.get()) == 0) {
    return std::nullopt;
  }
  return std::string(PQgetvalue(result.get(), 0, 0),
                     static_cast<std::size_t>(PQgetlength(result.get(), 0, 0)));
}

void PostgresConnection::Execute(const std::string& sql) {
  Check(Result(PQexec(connection_.get(), sql.c_str())));
}

void PostgresConnection::Transact(const std::function<void(SqlConnection&)>& work) {
  Execute("BEGIN");
  try {
    work(*this);
    Execute("COMMIT");
  } catch (...) {
    if (PQstatus(connection_.get()) == CONNECTION_OK) {
      Result(PQexec(connection_.get(), "ROLLBACK"));
    }
    throw;
  }
}

// One that nobody uses has nothing to say, unless it is that the database goes.
bool PostgresConnection::Alive() {
  pollfd event{PQsocket(connection_.get()), POLLIN, 0};
  if (::poll(&event, 1, 0) > 0 && PQconsumeInput(connection_.get()) == 0) {
    return false;
  }
  return PQstatus(connection_.get()) == CONNECTION_OK &&
         PQtransactionStatus(connection_.get()) == PQTRANS_IDLE;
}

bool PostgresConnection::WaitForNotice(const Descriptor& stop, std::chrono::milliseconds most) {
  std::array<pollfd, 2> events = {{{PQsocket(connection_.get()), POLLIN, 0}, {stop.get(), POLLIN, 0}}};
  ::poll(events.data(), events.size(), static_cast<int>(most.count()));
  if (PQconsumeInput(connection_.get()) == 0) {
    Fail();
  }
  bool any = false;
  while (PGnotify* notice = PQnotifies(connection_.get())) {
    PQfreemem(notice);
    any = true;
  }
  return any;
}

PostgresPool::PostgresPool(const std::string& url, std::function<void(PostgresConnection&)> prepare)
    : url_(url), prepare_(std::move(prepare)), refused_(Clock::now() - kAfterRefusal) {
  Settings(url);
}

std::unique_ptr<PostgresConnection> PostgresPool::Connect() {
  {
    const std::lock_guard lock(mutex_);
    if (Clock::now() - refused_ < kAfterRefusal) {
      throw QueueError(refusal_);
    }
  }
  try {
    auto connection = std::make_unique<PostgresConnection>(url_);
    const std::lock_guard lock(prepare_mutex_);
    if (!prepared_) {
      prepare_(*connection);
      prepared_ = true;
    }
    return connection;
  } catch (const QueueError& error) {
    const std::lock_guard lock(mutex_);
    refused_ = Clock::now();
    refusal_ = error.what();
    throw;
  }
}

std::unique_ptr<PostgresConnection> PostgresPool::Take() {
  std::unique_lock lock(mutex_);
  if (!put_.wait_for(lock, kWaitForConnection, [&] { return taken_ < kConnections; })) {
    throw QueueError("the database: all connections are in use");
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
