// Requests as they come over a connection, to the whole service: an input is what one client sends before it
// closes its side. The word JOB in it stands for a job that is there. Whatever comes is answered in form, or
// not at all, and never with a 500.
#include <sys/socket.h>

#include <array>
#include <memory>

#include "tests/fuzz/fuzz.h"
#include "tests/server/service_test.h"

namespace {

using namespace radbake;

// A service without workers: what is posted waits.
struct World {
  server::TemporaryFolder folder;
  server::Service service{folder.path() / "data", "/bin/false", Options()};
  std::string job = service.client().PostScene();
  // What the service makes when it is first asked for has to live longer than it.
  int page = service.client().Get("/").status;
  int metrics = service.client().Get("/metrics").status;

  static server::Service::Options Options() {
    server::Service::Options options;
    options.workers = 0;
    options.limits.upload = 1 << 16;
    // A client closes its side at once: whoever is late is on a machine that is too busy.
    options.limits.idle_time = std::chrono::minutes(1);
    options.limits.head_time = std::chrono::minutes(1);
    options.origins = {"https://example.org"};
    return options;
  }
};

World& TheWorld() {
  static World world;
  return world;
}

std::string WithJob(std::string text, const std::string& job) {
  for (std::size_t at = text.find("JOB"); at != std::string::npos; at = text.find("JOB", at + job.size())) {
    text.replace(at, 3, job);
  }
  return text;
}

std::string Exchange(int port, const std::string& request) {
  const server::Descriptor connection = server::Connect(port, request);
  ::shutdown(connection.get(), SHUT_WR);
  std::string answer;
  std::array<char, 65536> buffer{};
  for (ssize_t count = 0; (count = ::recv(connection.get(), buffer.data(), buffer.size(), 0)) > 0;) {
    answer.append(buffer.data(), static_cast<std::size_t>(count));
  }
  return answer;
}

void Check(const std::string& answer) {
  if (answer.empty()) {
    return;
  }
  fuzz::Demand(answer.starts_with("HTTP/1.1 "), "an answer is HTTP");
  fuzz::Demand(answer.substr(9, 3) != "500", "the service does not fail");
  const std::size_t head = answer.find("\r\n\r\n");
  fuzz::Demand(head != std::string::npos, "a head ends");
  fuzz::Demand(answer.starts_with("HTTP/1.1 100") ||
                   answer.substr(0, head).find("\r\nX-Request-Id: ") != std::string::npos,
               "an answer has an id");
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  World& world = TheWorld();
  const server::Client client = world.service.client();
  const std::string id = world.job.substr(world.job.rfind('/') + 1);
  const std::string request = WithJob(std::string(fuzz::Text(data, size)), id);
  const std::string answer = Exchange(world.service.port(), request);
  Check(answer);
  // Jobs do not pile up, and one is always there.
  constexpr std::string_view kLocation = "\r\nLocation: ";
  if (const std::size_t made = answer.find(kLocation); made != std::string::npos) {
    const std::size_t begin = made + kLocation.size();
    const std::string job = answer.substr(begin, answer.find('\r', begin) - begin);
    const server::Answer deleted =
        job == world.job ? server::Answer{204, {}, ""} : client.Request("DELETE", job);
    if (deleted.status != 204) {
      std::fprintf(stderr, "%s\nDELETE %s: %d %s\n", answer.c_str(), job.c_str(), deleted.status,
                   deleted.body.c_str());
    }
    fuzz::Demand(deleted.status == 204, "what is made can be deleted");
  }
  if (answer.starts_with("HTTP/1.1 204") && client.Get(world.job).status == 404) {
    world.job = client.PostScene();
  }
  return 0;
}
