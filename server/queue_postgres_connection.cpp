#include "server/queue_postgres_connection.h"

#include <libpq-fe.h>
#include <poll.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <utility>

namespace radbake::server {
namespace {

using Clock = std::chrono::steady_clock;

struct OptionsFreer {
  void operator()(PQconninfoOption* options) const { PQconninfoFree(options); }
};
using UrlOptions = std::unique_ptr<PQconninfoOption, OptionsFreer>;

std::string Message(const char* message) {
  std::string text(message == nullptr ? "" : message);
  text.erase(text.find_last_not_of(" \n\t") + 1);
  return text;
}

UrlOptions ParseUrl(const std::string& url) {
  char* error = nullptr;
  UrlOptions options(PQconninfoParse(url.c_str(), &error));
  if (options == nullptr) {
    const std::string why = Message(error);
    PQfreemem(error);
    throw QueueError("the database's URL: " + why);
  }
  return options;
}

// The URL's settings, and ours where it has none.
std::vector<std::pair<std::string, std::string>> Settings(const std::string& url,
                                                          std::chrono::seconds patience) {
  std::vector<std::pair<std::string, std::string>> settings = {
      {"connect_timeout", std::to_string(patience.count())},
      {"keepalives_idle", "5"},
      {"keepalives_interval", "2"},
      {"keepalives_count", "3"},
      {"tcp_user_timeout", std::to_string(std::chrono::milliseconds(patience).count())},
      {"application_name", "radbaked"}};
  const UrlOptions options = ParseUrl(url);
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option) {
    if (option->val != nullptr) {
      std::erase_if(settings, [&](const auto& setting) { return setting.first == option->keyword; });
      settings.emplace_back(option->keyword, option->val);
    }
  }
  return settings;
}

// Nor does the database wait long for a client that has gone. Who waits for a lock hears so before it gives
// up the connection, and what takes long here comes to its end there.
std::string Session(std::chrono::milliseconds patience) {
  const auto milliseconds = [](std::chrono::milliseconds time) { return std::to_string(time.count()); };
  return "SET search_path TO radbake; SET standard_conforming_strings TO on;"
         "SET client_min_messages TO warning; SET statement_timeout TO '60s';"
         "SET tcp_keepalives_idle TO 5; SET tcp_keepalives_interval TO 2; SET tcp_keepalives_count TO 3;"
         "SET lock_timeout TO " +
         milliseconds(patience * 3 / 4) + "; SET idle_in_transaction_session_timeout TO " +
         milliseconds(patience * 2);
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

bool Succeeded(const PGresult* result) {
  const ExecStatusType status = PQresultStatus(result);
  return status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK;
}

}  // namespace

void CheckPostgresUrl(const std::string& url) {
  ParseUrl(url);
}

void PostgresConnection::Closer::operator()(pg_conn* connection) const {
  PQfinish(connection);
}

void PostgresConnection::Clearer::operator()(pg_result* result) const {
  PQclear(result);
}

PostgresConnection::PostgresConnection(const std::string& url, std::chrono::seconds patience)
    : patience_(patience) {
  const auto settings = Settings(url, patience);
  std::vector<const char*> keywords;
  std::vector<const char*> values;
  for (const auto& [keyword, value] : settings) {
    keywords.push_back(keyword.c_str());
    values.push_back(value.c_str());
  }
  keywords.push_back(nullptr);
  values.push_back(nullptr);
  // It keeps to connect_timeout, for each host, also where a server takes the connection and says nothing.
  connection_.reset(PQconnectdbParams(keywords.data(), values.data(), 0));
  if (connection_ == nullptr || PQstatus(connection_.get()) != CONNECTION_OK ||
      PQsetnonblocking(connection_.get(), 1) != 0) {
    Fail();
  }
  PQsetNoticeProcessor(
      connection_.get(),
      [](void*, const char* message) { spdlog::warn("the database: {}", Message(message)); }, nullptr);
  Execute(Session(patience));
}

PostgresConnection::~PostgresConnection() = default;

void PostgresConnection::Fail() const {
  throw QueueError("the database: " + Message(PQerrorMessage(connection_.get())));
}

// Until there is something to read or to write.
void PostgresConnection::Wait(short events, Deadline deadline) {
  while (true) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
    pollfd event{PQsocket(connection_.get()), events, 0};
    const int ready = ::poll(&event, 1, static_cast<int>(std::max<std::int64_t>(left.count(), 0)));
    if (ready > 0) {
      return;
    }
    if (ready == 0) {
      connection_.reset();
      throw DatabaseSilent("the database: no answer within " + std::to_string(patience_.count()) +
                           " seconds");
    }
  }
}

// The last result of what has been sent, or the first that is a failure.
PostgresConnection::Result PostgresConnection::Await(bool sent) {
  if (!sent) {
    Fail();
  }
  const Deadline deadline = Clock::now() + patience_;
  int unsent = 0;
  while ((unsent = PQflush(connection_.get())) > 0) {
    Wait(POLLIN | POLLOUT, deadline);
    if (PQconsumeInput(connection_.get()) == 0) {
      Fail();
    }
  }
  if (unsent < 0) {
    Fail();
  }
  Result last;
  while (true) {
    while (PQisBusy(connection_.get()) != 0) {
      Wait(POLLIN, deadline);
      if (PQconsumeInput(connection_.get()) == 0) {
        Fail();
      }
    }
    Result result(PQgetResult(connection_.get()));
    if (result == nullptr) {
      break;
    }
    if (last == nullptr || Succeeded(last.get())) {
      last = std::move(result);
    }
  }
  if (!Succeeded(last.get())) {
    Fail();
  }
  return last;
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
  return Await(PQsendQueryParams(connection_.get(), sql.c_str(), static_cast<int>(pointers.size()), nullptr,
                                 pointers.data(), lengths.data(), formats.data(), result_format) != 0);
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
  Await(PQsendQuery(connection_.get(), sql.c_str()) != 0);
}

void PostgresConnection::Transact(const std::function<void(SqlConnection&)>& work) {
  Execute("BEGIN");
  try {
    work(*this);
    Execute("COMMIT");
  } catch (...) {
    if (PQstatus(connection_.get()) == CONNECTION_OK) {
      try {
        Execute("ROLLBACK");
      } catch (const QueueError&) {
        connection_.reset();  // with which it is undone
      }
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

}  // namespace radbake::server
