/// What the tests of the service share: a folder of their own, a stand-in for radbake, the service and its
/// client.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "server/http.h"
#include "server/jobs.h"

namespace radbake::server {

/// A new folder, removed at the end.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

std::string ReadFile(const std::filesystem::path& path);
void WriteFile(const std::filesystem::path& path, const std::string& text);

/// The paths of all files and folders below a folder, relative to it, in order.
std::vector<std::string> ListTree(const std::filesystem::path& folder);

/// True as soon as `done` is; false after a minute.
bool Eventually(const std::function<bool()>& done);

/// A shell script that is called as radbake is, in the job's folder.
std::filesystem::path WriteProgram(const std::filesystem::path& path, const std::string& script);

/// Writes a result and statistics, as radbake does in the end.
inline const std::string kBakes = R"(
printf 'glTF baked' > attempt/baked.glb
printf '{"version":"0"}' > attempt/statistics.json
)";

struct Answer {
  int status = 0;                              ///< 0: there was none, or one that was cut short
  std::map<std::string, std::string> headers;  ///< names in lower case
  std::string body;
  nlohmann::json Json() const { return nlohmann::json::parse(body, nullptr, false); }
};

/// A connection to a port of this machine over which these bytes have been sent.
Descriptor Connect(int port, const std::string& bytes);

/// Adds what comes to `text` until it holds `end`. False if the other side closes before, or after a minute.
bool ReceiveUntil(const Descriptor& connection, const std::string& end, std::string& text);

/// What comes back of a request, or of its begin, until the other side closes or is silent for two minutes.
/// Where the environment's RADBAKED_ANSWERS names a folder, a line {"method", "target", "status", "headers",
/// "body"} is added there to a file of this process, for tests/openapi to judge.
Answer Receive(const Descriptor& connection, const std::string& request);

/// Connect() and Receive().
Answer Send(int port, const std::string& bytes);

struct FormPart {
  std::string name;
  std::string content;
  std::string filename;
};

class Client {
 public:
  explicit Client(int port) : port_(port) {}
  Answer Request(const std::string& method, const std::string& path, const std::string& headers = "",
                 const std::string& body = "") const;
  Answer Get(const std::string& path) const { return Request("GET", path); }
  Answer Post(const std::string& body, const std::string& type) const;
  Answer PostForm(const std::vector<FormPart>& parts) const;
  /// Posts a scene that is taken; the path of its job.
  std::string PostScene() const;
  /// The job as soon as its status is this one.
  nlohmann::json WaitFor(const std::string& job, const std::string& status) const;

 private:
  int port_;
};

/// The bytes of a .glb as far as the service looks at it.
std::string Glb(const std::string& rest = "");

/// The service in this process.
class Service {
 public:
  struct Options {
    int workers = 1;
    std::chrono::milliseconds keep = std::chrono::hours(1);
    HttpLimits limits = SmallLimits();
    std::string tokens;        ///< empty: none
    ChildLimits child_limits;  ///< none
    std::uint64_t least_free = 0;
    std::set<std::string> origins = {};
    Role role = Role::kAll;
  };
  /// As by default, but of uploads only a megabyte.
  static HttpLimits SmallLimits();

  Service(const std::filesystem::path& data, const std::filesystem::path& radbake, const Options& options);
  Service(const std::filesystem::path& data, const std::filesystem::path& radbake, int workers = 1)
      : Service(data, radbake,
                Options{workers, std::chrono::hours(1), SmallLimits(), "", {}, 0, {}, Role::kAll}) {}
  ~Service();
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;
  Client client() const { return Client(server_.port()); }
  int port() const { return server_.port(); }

 private:
  Jobs jobs_;
  HttpServer server_;
  std::thread listener_;
};

/// The program radbaked, in a process of its own.
class Daemon {
 public:
  Daemon(const std::filesystem::path& data, const std::filesystem::path& radbake,
         const std::vector<std::string>& more = {});
  ~Daemon();
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;
  int port() const { return port_; }  ///< 0: it did not come to listen
  Client client() const { return Client(port_); }
  /// What it has written to standard error, so far.
  std::string Log() const;
  void Signal(int signal) const;
  /// Sends the signal and waits; the exit code, or minus the signal that ended it.
  int End(int signal);

 private:
  int pid_ = -1;
  int port_ = 0;
  std::filesystem::path log_;
};

}  // namespace radbake::server
