// What Prometheus gets to read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <regex>
#include <set>
#include <sstream>

#include "server/digest.h"
#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

using ::testing::HasSubstr;

// The text format 0.0.4, as strictly as promtool takes it: every sample under its family's HELP and TYPE, no
// family in two places, names and units as they should be, histograms that add up.
class Exposition {
 public:
  explicit Exposition(const std::string& text) {
    EXPECT_TRUE(text.ends_with('\n'));
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      line.starts_with("#") ? ReadComment(line) : ReadSample(line);
    }
    EXPECT_EQ(helped_, typed_);
  }

  // The value of a sample as it is written, NaN where it is not there.
  double Value(const std::string& sample) const {
    const auto found = values_.find(sample);
    return found == values_.end() ? std::nan("") : found->second;
  }

  // Buckets count what is at most their bound, and the last one counts all.
  void ExpectHistogram(const std::string& name) const {
    double before = 0;
    double last = -1;
    int buckets = 0;
    for (const auto& [sample, value] : in_order_) {
      if (sample.starts_with(name + "_bucket{le=\"")) {
        const std::string bound = sample.substr(name.size() + 12);
        const double number = bound.starts_with("+Inf") ? HUGE_VAL : std::stod(bound);
        EXPECT_GT(number, last) << sample;
        EXPECT_GE(value, before) << sample;
        last = number;
        before = value;
        ++buckets;
      }
    }
    EXPECT_GT(buckets, 5);
    EXPECT_EQ(last, HUGE_VAL);
    EXPECT_EQ(before, Value(name + "_count"));
    EXPECT_GE(Value(name + "_sum"), 0);
  }

 private:
  void ReadComment(const std::string& line) {
    static const std::regex kForm(R"(# (HELP|TYPE) ([a-z_]+) (.+))");
    std::smatch match;
    ASSERT_TRUE(std::regex_match(line, match, kForm)) << line;
    family_ = match[2];
    EXPECT_TRUE((match[1] == "HELP" ? helped_ : typed_).insert(family_).second) << "twice: " << line;
    if (match[1] == "TYPE") {
      type_ = match[3];
      EXPECT_THAT(type_, testing::AnyOf("counter", "gauge", "histogram"));
      EXPECT_EQ(family_.ends_with("_total"), type_ == "counter") << family_;
    }
    EXPECT_THAT(family_, testing::MatchesRegex("(radbaked|process)_[a-z_]+"));
  }
  void ReadSample(const std::string& line) {
    static const std::regex kForm(R"re(([a-z_]+)(\{[a-z]+="[^"\\]*"(,[a-z]+="[^"\\]*")*\})? ([0-9.e+-]+))re");
    std::smatch match;
    ASSERT_TRUE(std::regex_match(line, match, kForm)) << line;
    const std::string name = match[1];
    const std::string part = name.size() > family_.size() ? name.substr(family_.size()) : "";
    EXPECT_TRUE(name.starts_with(family_)) << line << " is under " << family_;
    EXPECT_EQ(type_ == "histogram", part == "_bucket" || part == "_sum" || part == "_count") << line;
    EXPECT_TRUE(type_ == "histogram" || part.empty()) << line;
    const double value = std::stod(match[4]);
    EXPECT_TRUE(values_.emplace(line.substr(0, line.rfind(' ')), value).second) << "twice: " << line;
    in_order_.emplace_back(line.substr(0, line.rfind(' ')), value);
  }

  std::string family_;
  std::string type_;
  std::set<std::string> helped_;
  std::set<std::string> typed_;
  std::map<std::string, double> values_;
  std::vector<std::pair<std::string, double>> in_order_;
};

class MetricsTest : public testing::Test {
 protected:
  std::filesystem::path data() const { return folder_.path() / "data"; }
  std::filesystem::path Program(const std::string& script) const {
    return WriteProgram(folder_.path() / "radbake", script);
  }
  static Exposition Read(const Service& service) {
    const Answer answer = service.client().Get("/metrics");
    EXPECT_EQ(answer.status, 200);
    EXPECT_EQ(answer.headers.at("content-type"), "text/plain; version=0.0.4; charset=utf-8");
    return Exposition(answer.body);
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(MetricsTest, AreThereBeforeAnythingHasHappened) {
  const Service service(data(), Program(kBakes));
  const Exposition metrics = Read(service);
  for (const char* state : {"queued", "running", "succeeded", "failed", "canceled"}) {
    EXPECT_EQ(metrics.Value("radbaked_jobs{state=\"" + std::string(state) + "\"}"), 0) << state;
  }
  metrics.ExpectHistogram("radbaked_job_queue_seconds");
  metrics.ExpectHistogram("radbaked_bake_seconds");
  EXPECT_EQ(metrics.Value("radbaked_build_info{version=\"" RADBAKE_VERSION "\"}"), 1);
  EXPECT_EQ(metrics.Value("radbaked_http_connections"), 1) << "this one";
  EXPECT_GT(metrics.Value("radbaked_disk_free_bytes"), 0);
  EXPECT_EQ(metrics.Value("radbaked_queue_up"), 1);
  EXPECT_GT(metrics.Value("process_resident_memory_bytes"), 1e6);
}

TEST_F(MetricsTest, CountWhatABakeTookAndGave) {
  const Service service(data(), Program("printf 'glTF baked' > attempt/baked.glb\n"
                                        "printf '{\"rays\":{\"count\":4200}}' > attempt/statistics.json\n"));
  for (int i = 0; i < 2; ++i) {
    service.client().WaitFor(service.client().PostScene(), "succeeded");
  }
  const Exposition metrics = Read(service);
  EXPECT_EQ(metrics.Value("radbaked_jobs{state=\"succeeded\"}"), 2);
  EXPECT_EQ(metrics.Value("radbaked_bakes_total{outcome=\"baked\"}"), 2);
  EXPECT_EQ(metrics.Value("radbaked_rays_total"), 8400);
  EXPECT_EQ(metrics.Value("radbaked_job_queue_seconds_count"), 2);
  EXPECT_EQ(metrics.Value("radbaked_bake_seconds_count"), 2);
  EXPECT_GT(metrics.Value("radbaked_bake_seconds_sum"), 0);
  metrics.ExpectHistogram("radbaked_job_queue_seconds");
  metrics.ExpectHistogram("radbaked_bake_seconds");
}

TEST_F(MetricsTest, CountWhatKilledTheChildren) {
  const std::string kKilled = "radbaked_children_killed_total{reason=\"";
  {
    const Service service(data(), Program("kill -KILL $$"));
    service.client().WaitFor(service.client().PostScene(), "failed");
    EXPECT_EQ(Read(service).Value(kKilled + "signal\"}"), 3);
    EXPECT_EQ(Read(service).Value("radbaked_bakes_total{outcome=\"failed\"}"), 3);
    EXPECT_EQ(Read(service).Value("radbaked_job_queue_seconds_count"), 1) << "the first attempt's alone";
  }
  {
    const Service service(data(), Program("exec sleep 1000"));
    const std::string job = service.client().PostScene();
    service.client().WaitFor(job, "running");
    service.client().Request("POST", job + "/cancel");
    EXPECT_TRUE(Eventually([&] { return Read(service).Value(kKilled + "stopped\"}") == 1; }));
  }
  ChildLimits limits;
  limits.time = std::chrono::seconds(1);
  const Service service(data(), Program("exec sleep 1000"),
                        {1, std::chrono::hours(1), Service::SmallLimits(), "", limits, 0, {}});
  service.client().WaitFor(service.client().PostScene(), "failed");
  EXPECT_EQ(Read(service).Value(kKilled + "time\"}"), 1);
}

TEST_F(MetricsTest, CountRequestsByRouteAndStatusHoweverMadeUpTheirPathsAre) {
  const Service service(data(), Program(kBakes));
  const Client client = service.client();
  const std::string job = client.PostScene();
  client.WaitFor(job, "succeeded");
  client.Get(job + "/scene");
  client.Get("/nothing/\"here\"");
  client.Get("/v1/bakes/00112233445566778899aabbccddeeff");
  client.Request("OPTIONS", "/v1/bakes");
  Send(service.port(), "a b: c\r\nno header\r\n\r\n");
  const Answer held =
      client.Request("POST", "/v1/bakes",
                     "Content-Type: model/gltf-binary\r\nContent-Length: 12\r\nPrefer: wait=60\r\n", Glb());
  EXPECT_EQ(held.status, 200);
  const Exposition metrics = Read(service);
  const auto count = [&](const std::string& route, const std::string& method, int status) {
    return metrics.Value("radbaked_http_requests_total{route=\"" + route + "\",method=\"" + method +
                         "\",status=\"" + std::to_string(status) + "\"}");
  };
  EXPECT_EQ(count("/v1/bakes", "POST", 202), 1);
  EXPECT_EQ(count("/v1/bakes", "POST", 200), 1) << "the held one, once";
  EXPECT_GE(count("/v1/bakes/{id}", "GET", 200), 1);
  EXPECT_EQ(count("/v1/bakes/{id}/scene", "GET", 200), 1);
  EXPECT_EQ(count("other", "GET", 404), 1);
  EXPECT_EQ(count("/v1/bakes/{id}", "GET", 404), 1);
  EXPECT_EQ(count("/v1/bakes", "OPTIONS", 405), 1);
  EXPECT_EQ(count("other", "other", 400), 1);
  EXPECT_GT(metrics.Value("radbaked_http_received_bytes_total"), 100);
  EXPECT_GT(metrics.Value("radbaked_http_sent_bytes_total"), 1000);
}

TEST_F(MetricsTest, NeedATokenWhereThereAreTokens) {
  const Service service(
      data(), Program(kBakes),
      {1, std::chrono::hours(1), Service::SmallLimits(), "me " + Sha256Hex("secret") + "\n", {}, 0, {}});
  EXPECT_EQ(service.client().Get("/metrics").status, 401);
  EXPECT_EQ(service.client().Request("GET", "/metrics", "Authorization: Bearer secret\r\n").status, 200);
  EXPECT_EQ(service.client().Get("/readyz").status, 200) << "which says nothing of anybody";
}

TEST_F(MetricsTest, ReadinessNamesWhatIsMissing) {
  {
    const Service service(data(), Program(kBakes));
    const Answer ready = service.client().Get("/readyz");
    EXPECT_EQ(ready.status, 200);
    EXPECT_EQ(ready.Json(), nlohmann::json({{"status", "ready"}}));
    std::filesystem::remove_all(data() / "jobs");
    const Answer gone = service.client().Get("/readyz");
    EXPECT_EQ(gone.status, 503);
    EXPECT_EQ(gone.headers.at("content-type"), "application/problem+json");
    EXPECT_THAT(gone.body, HasSubstr("data folder"));
    EXPECT_EQ(service.client().Get("/healthz").status, 200) << "it lives all the same";
    EXPECT_THAT(service.client().Get("/metrics").body, testing::Not(HasSubstr("radbaked_disk_free_bytes")));
  }
  {
    const Service idle(data(), Program(kBakes), 0);
    const Answer answer = idle.client().Get("/readyz");
    EXPECT_EQ(answer.status, 503);
    EXPECT_THAT(answer.body, HasSubstr("no worker takes jobs"));
  }
  const Service full(data(), Program(kBakes),
                     {1, std::chrono::hours(1), Service::SmallLimits(), "", {}, UINT64_MAX, {}});
  const Answer answer = full.client().Get("/readyz");
  EXPECT_EQ(answer.status, 503);
  EXPECT_THAT(answer.body, HasSubstr("disk has less"));
  EXPECT_TRUE(answer.headers.contains("retry-after"));
}

}  // namespace
}  // namespace radbake::server
