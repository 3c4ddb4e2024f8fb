#include "server/trouble_log.h"

#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <sstream>

namespace radbake::server {
namespace {

using namespace std::chrono_literals;

// What is logged from here on.
class Logged {
 public:
  Logged() : before_(spdlog::default_logger()) {
    auto logger =
        std::make_shared<spdlog::logger>("logged", std::make_shared<spdlog::sinks::ostream_sink_mt>(text_));
    logger->set_pattern("%v");
    spdlog::set_default_logger(std::move(logger));
  }
  ~Logged() { spdlog::set_default_logger(before_); }
  Logged(const Logged&) = delete;
  Logged& operator=(const Logged&) = delete;
  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
  std::shared_ptr<spdlog::logger> before_;
};

TEST(TroubleLog, SaysOnceAMinuteWhatIsMetAllTheTime) {
  const Logged logged;
  TroubleLog log("over");
  TroubleLog::Clock::time_point now;
  for (int i = 0; i <= 600; ++i, now += 100ms) {
    log.Meet("it is away", now);
  }
  EXPECT_EQ(logged.text(), "it is away: it is tried again\nit is away: it is tried again\n");
}

TEST(TroubleLog, SaysOnceThatItIsOver) {
  const Logged logged;
  TroubleLog log("over");
  TroubleLog::Clock::time_point now;
  log.Miss(now);
  EXPECT_EQ(logged.text(), "") << "nothing was";
  for (int i = 0; i < 20; ++i, now += 1s) {
    log.Meet("one fails", now);
    log.Miss(now);
  }
  EXPECT_EQ(logged.text(), "one fails: it is tried again\n") << "another's success is no end of it";
  now += 10s;
  log.Miss(now);
  log.Miss(now);
  log.Meet("again", now);
  EXPECT_EQ(logged.text(), "one fails: it is tried again\nover\nagain: it is tried again\n");
}

}  // namespace
}  // namespace radbake::server
