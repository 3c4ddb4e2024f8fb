#include "server/log.h"

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace radbake::server {
namespace {

thread_local std::vector<LogScope::Member> members;

class JsonFormatter final : public spdlog::formatter {
 public:
  // Called in the thread that logs: the loggers are synchronous.
  void format(const spdlog::details::log_msg& line,
              spdlog::memory_buf_t& to) override {  // NOLINT(readability-identifier-naming)
    const std::string_view level(spdlog::level::to_string_view(line.level).data(),
                                 spdlog::level::to_string_view(line.level).size());
    spdlog::memory_buf_t time;
    time_.format(line, time);
    nlohmann::ordered_json object = {{"time", std::string_view(time.data(), time.size())},
                                     {"level", level},
                                     {"message", std::string_view(line.payload.data(), line.payload.size())}};
    for (const auto& [name, value] : members) {
      object[name] = value;
    }
    const std::string text =
        object.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
    to.append(text.data(), text.data() + text.size());
  }
  std::unique_ptr<spdlog::formatter> clone() const override {  // NOLINT(readability-identifier-naming)
    return std::make_unique<JsonFormatter>();
  }

 private:
  spdlog::pattern_formatter time_{"%Y-%m-%dT%H:%M:%S.%eZ", spdlog::pattern_time_type::utc, ""};
};

}  // namespace

void StartLog() {
  auto logger =
      std::make_shared<spdlog::logger>("radbaked", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_formatter(std::make_unique<JsonFormatter>());
  spdlog::set_default_logger(std::move(logger));
}

LogScope::LogScope(std::initializer_list<Member> added) : before_(members.size()) {
  members.insert(members.end(), added.begin(), added.end());
}

LogScope::~LogScope() {
  members.resize(before_);
}

}  // namespace radbake::server
