// Every answer that the service's description promises is provoked, so that tests/openapi judges each, and
// none is promised that nobody can get.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <utility>

#include "server/digest.h"
#include "tests/server/http_test.h"
#include "tests/server/queue_test.h"

namespace radbake::server {
namespace {

constexpr std::size_t kTooManyBytes = 20'000;  // of a head
const std::string kLongQuery = "?" + std::string(1100, 'x');
const std::string kAsPage = "Origin: https://example.org\r\nAccess-Control-Request-Method: GET\r\n";
const std::string kGlbType = "Content-Type: model/gltf-binary\r\n";
const std::string kGlbHeaders = kGlbType + "Content-Length: 12\r\n";

// A method and a path of the description, and how to ask for it.
struct Operation {
  std::string method;
  std::string path;
  std::string job;  ///< whose path stands for /v1/bakes/{id}

  std::string Head(const std::string& headers = "", const std::string& query = "") const {
    std::string target = path;
    const std::string template_of_job = "/v1/bakes/{id}";
    if (target.starts_with(template_of_job)) {
      target = job + target.substr(template_of_job.size());
    }
    if (const std::size_t module = target.find("{module}"); module != std::string::npos) {
      target = target.substr(0, module) + (job == kNoJob ? "build/none.js" : "build/three.module.js");
    }
    return method + " " + target + query + " HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n";
  }
};

// Services in all the states that an answer takes.
class OpenApiAnswersTest : public testing::Test {
 protected:
  OpenApiAnswersTest() {
    done_ = plain_.client().PostScene();
    plain_.client().WaitFor(done_, "succeeded");
    waiting_ = idle_.client().PostScene();
    lost_ = broken_.client()
                .Request("POST", "/v1/bakes", kGlbHeaders + "Idempotency-Key: lost\r\n", Glb())
                .headers.at("location");
    RunInSqlite(broken_folder_ / "jobs.sqlite", "UPDATE jobs SET told = 'no JSON'");
    only_ = Connect(full_.port(), "GET");
  }

  Answer Provoke(const std::string& name, Operation asked, int status) {
    asked.job = done_;
    const bool post = asked.method == "POST" && asked.path == "/v1/bakes";
    const auto ask = [&](const Service& service, const std::string& headers, const std::string& query = "") {
      return Send(service.port(),
                  asked.Head((post ? kGlbHeaders : "") + headers, query) + (post ? Glb() : ""));
    };
    switch (status) {
      case 200:
        if (asked.path.ends_with("/cancel")) {
          asked.job = idle_.client().PostScene();
          return ask(idle_, "");
        }
        return ask(plain_, post ? "Prefer: wait=60\r\n" : "");
      case 202:
        return ask(idle_, "");
      case 204:
        if (asked.method == "DELETE") {
          asked.job = plain_.client().PostScene();
          return ask(plain_, "");
        }
        return ask(plain_, asked.method == "OPTIONS" ? kAsPage : "Last-Event-ID: " + LastEvent() + "\r\n");
      case 206:
        return ask(plain_, "Range: bytes=0-1\r\n");
      case 304:
        return ask(plain_, "If-None-Match: *\r\n");
      case 400:
        return ask(plain_, "no header\r\n");
      case 401:
        return ask(closed_, "");
      case 404:
        asked.job = kNoJob;
        return ask(asked.path.find('{') == std::string::npos ? worker_ : plain_, "");
      case 405:
        return ask(plain_, "");
      case 409:
        asked.job = asked.path.ends_with("/cancel") ? done_ : waiting_;
        return ask(asked.path.ends_with("/cancel") ? plain_ : idle_, "");
      case 411:
        return Send(plain_.port(), asked.Head(kGlbType));
      case 413:
        return Send(plain_.port(), asked.Head(kGlbType + "Content-Length: 9999999\r\n"));
      case 414:
        return ask(plain_, "", kLongQuery);
      case 415:
        return Send(plain_.port(), asked.Head("Content-Length: 0\r\n"));
      case 416:
        return ask(plain_, "Range: bytes=1000-\r\n");
      case 422:
        return Send(plain_.port(), asked.Head(kGlbType + "Content-Length: 1\r\n") + "x");
      case 429:
        return ask(closed_, "Authorization: Bearer secret\r\n");
      case 431:
        return ask(plain_, "X: " + std::string(kTooManyBytes, 'x') + "\r\n");
      case 500:
        asked.job = lost_;
        return ask(broken_, post ? "Idempotency-Key: lost\r\n" : "");
      case 503:
        return ask(full_, "");
      default:
        ADD_FAILURE() << name << ": nobody knows how to get a " << status;
        return {};
    }
  }

  // Of all at once: each takes its time.
  void BeginLate(const std::string& name, Operation asked) {
    asked.job = done_;
    std::string head = asked.Head();
    head.resize(head.size() - 2);
    late_.emplace_back(name, std::pair(Connect(slow_.port(), head), head));
  }
  void ExpectLate() const {
    for (const auto& [name, asked] : late_) {
      EXPECT_EQ(Receive(asked.first, asked.second).status, 408) << name;
    }
  }
  nlohmann::json Document() const { return plain_.client().Get("/openapi.json").Json(); }

 private:
  Service::Options With(int workers, const HttpLimits& limits = Service::SmallLimits()) const {
    Service::Options options;
    options.workers = workers;
    options.limits = limits;
    options.origins = {"https://example.org"};
    return options;
  }
  Service::Options OfClients() const {
    HttpLimits limits = Service::SmallLimits();
    limits.queued_of_one = 0;
    Service::Options options = With(0, limits);
    options.tokens = "me " + Sha256Hex("secret") + "\n";
    return options;
  }
  Service::Options Worker() const {
    Service::Options options = With(1);
    options.role = Role::kWorker;
    return options;
  }
  static HttpLimits OneConnection() {
    HttpLimits limits = Service::SmallLimits();
    limits.connections = 1;
    return limits;
  }
  static HttpLimits Hasty() {
    HttpLimits limits = Service::SmallLimits();
    limits.head_time = std::chrono::seconds(1);
    return limits;
  }
  std::string LastEvent() const {
    const std::string events = plain_.client().Get(done_ + "/events").body;
    const std::size_t begin = events.find("\nid: ") + 5;
    return events.substr(begin, events.find('\n', begin) - begin);
  }
  std::filesystem::path At(const std::string& name) const { return folder_.path() / name; }

  TemporaryFolder folder_;
  std::filesystem::path broken_folder_ = At("broken");
  std::filesystem::path program_ = WriteProgram(At("radbake"), kBakes);
  Service plain_{At("plain"), program_, With(1)};
  Service idle_{At("idle"), program_, With(0)};
  Service closed_{At("closed"), program_, OfClients()};
  Service worker_{At("worker"), program_, Worker()};
  Service full_{At("full"), program_, With(0, OneConnection())};
  Service slow_{At("slow"), program_, With(0, Hasty())};
  Service broken_{broken_folder_, program_, With(0)};
  Descriptor only_;
  std::string done_;
  std::string waiting_;
  std::string lost_;
  std::vector<std::pair<std::string, std::pair<Descriptor, std::string>>> late_;
};

TEST_F(OpenApiAnswersTest, EachIsGivenThatIsDescribed) {
  const std::map<std::string, std::string> methods = {{"get", "GET"},       {"head", "HEAD"},
                                                      {"post", "POST"},     {"put", "PUT"},
                                                      {"delete", "DELETE"}, {"options", "OPTIONS"}};
  const nlohmann::json document = Document();
  for (const auto& [path, item] : document.at("paths").items()) {
    for (const auto& [key, operation] : item.items()) {
      const auto method = methods.find(key);
      if (method == methods.end()) {
        continue;
      }
      for (const auto& [status, response] : operation.at("responses").items()) {
        const std::string name = method->second + " " + path + " " + status;
        const Operation asked{method->second, path, ""};
        if (status == "408") {
          BeginLate(name, asked);
        } else {
          EXPECT_EQ(Provoke(name, asked, std::stoi(status)).status, std::stoi(status)) << name;
        }
      }
    }
  }
  ExpectLate();
}

}  // namespace
}  // namespace radbake::server
