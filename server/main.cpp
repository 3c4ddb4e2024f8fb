// radbaked: the bake service. Exit codes: 0 stopped; 1 it cannot run; 2 bad usage.
#include <fcntl.h>
#include <pthread.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "server/http.h"
#include "server/jobs.h"
#include "server/log.h"
#include "server/memory.h"
#include "server/queue_postgres.h"
#include "solver/gltf/document.h"

namespace {

using radbake::server::HttpServer;
using radbake::server::Jobs;

// What is opened first must not become somebody's standard output.
void OpenStandardDescriptors() {
  while (true) {
    const int descriptor = ::open("/dev/null", O_RDWR | O_CLOEXEC);
    if (descriptor < 0 || descriptor > STDERR_FILENO) {
      ::close(descriptor);
      return;
    }
  }
}

// No other process of this user's reads the memory of this one, in which a password may be.
void HideMemory() {
#if !defined(RADBAKE_ADDRESS_SANITIZER)  // LeakSanitizer reads it from without
  ::prctl(PR_SET_DUMPABLE, 0);
#endif
}

std::filesystem::path DefaultData() {
  const char* state = std::getenv("XDG_STATE_HOME");
  if (state != nullptr && *state == '/') {
    return std::filesystem::path(state) / "radbake";
  }
  const char* home = std::getenv("HOME");
  if (home == nullptr || *home == '\0') {
    throw std::runtime_error("there is neither XDG_STATE_HOME nor HOME: --data says where the jobs are kept");
  }
  return std::filesystem::path(home) / ".local/state/radbake";
}

// HOST:PORT, with an IPv6 host in brackets.
void ParseListen(const std::string& text, HttpServer::Options& options) {
  const std::size_t colon = text.rfind(':');
  const std::string port = colon == std::string::npos ? "" : text.substr(colon + 1);
  std::string host = text.substr(0, std::min(colon, text.size()));
  if (host.starts_with('[') && host.ends_with(']')) {
    host = host.substr(1, host.size() - 2);
  }
  int number = -1;
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), number);
  if (host.empty() || error != std::errc() || end != port.data() + port.size() || number < 0 ||
      number > 65535) {
    throw CLI::ValidationError("--listen", "takes HOST:PORT, with a port from 0 to 65535");
  }
  options.host = host;
  options.port = number;
}

// A whole number with its unit.
std::chrono::seconds ParseDuration(const char* option, const std::string& text) {
  constexpr std::string_view kUnits = "smhd";
  constexpr std::array<std::int64_t, 4> kSeconds = {1, 60, 3600, 86400};
  constexpr std::int64_t kMost = 1'000'000;
  const std::size_t unit = text.empty() ? std::string_view::npos : kUnits.find(text.back());
  std::int64_t number = 0;
  const char* const last = text.data() + text.size() - (text.empty() ? 0 : 1);
  const auto [end, error] = std::from_chars(text.data(), last, number);
  if (unit == std::string_view::npos || error != std::errc() || end != last || number < 0 || number > kMost) {
    throw CLI::ValidationError(option, "takes a whole number and its unit: 90s, 30m, 24h or 7d");
  }
  return std::chrono::seconds(number * kSeconds.at(unit));
}

bool IsLoopback(const std::string& host) {
  return host == "localhost" || host == "::1" || host.starts_with("127.");
}

// The flags of all that is taken from clients.
void AddLimits(CLI::App& app, radbake::server::HttpLimits& limits) {
  const auto add = [&](const char* flag, auto& value, const char* means) {
    return app.add_option(flag, value, means)
        ->capture_default_str()
        ->check(CLI::NonNegativeNumber)
        ->group("Limits");
  };
  const auto add_seconds = [&](const char* flag, std::chrono::seconds& value, const char* means) {
    app.add_option_function<unsigned>(
           flag, [&value](unsigned seconds) { value = std::chrono::seconds(seconds); }, means)
        ->check(CLI::Range(1, 86400))
        ->default_str(std::to_string(value.count()))
        ->group("Limits");
  };
  add("--max-upload", limits.upload, "Bytes that a request may have");
  add("--max-parts", limits.parts, "Parts that a form may have");
  constexpr int kMostThreads = 1000;  // each has one
  add("--max-uploads", limits.uploads, "Uploads at a time")->check(CLI::Range(1, kMostThreads));
  add("--max-downloads", limits.downloads, "Results sent at a time, and other answers to slow clients")
      ->check(CLI::Range(1, kMostThreads));
  add("--max-queue", limits.queued, "Jobs that may wait");
  add("--max-queue-per-client", limits.queued_of_one, "Jobs of one client that may wait");
  add("--uploads-per-minute", limits.uploads_a_minute, "Of each client; 0: any number");
  add("--max-connections", limits.connections, "Connections at a time");
  add("--max-watchers", limits.watchers, "Event streams and held answers at a time");
  add("--max-head", limits.head, "Bytes of a request's line and headers");
  add("--max-headers", limits.headers, "Headers of a request");
  add("--least-rate", limits.least_rate, "Bytes a second that a body or an answer must move");
  add_seconds("--head-time", limits.head_time, "Seconds in which a request's headers must come");
  add_seconds("--idle-time", limits.idle_time, "Seconds that a body or an answer may stand still");
}

// The flags of what a bake may take.
void AddChildLimits(CLI::App& app, radbake::server::ChildLimits& limits) {
  const auto add = [&](const char* flag, std::uint64_t& value, const char* means) {
    return app.add_option(flag, value, means)->capture_default_str()->group("Limits of a bake (0: none)");
  };
  const auto add_seconds = [&](const char* flag, std::chrono::seconds& value, const char* means) {
    return app
        .add_option_function<unsigned>(
            flag, [&value](unsigned seconds) { value = std::chrono::seconds(seconds); }, means)
        ->default_str(std::to_string(value.count()))
        ->group("Limits of a bake (0: none)");
  };
  limits.open_files = 256;
  limits.file_size = 4ULL << 30U;
  limits.time = std::chrono::hours(1);
  limits.confined = true;
  add_seconds("--job-timeout", limits.time, "Seconds from its start to its end");
  add_seconds("--job-cpu-time", limits.cpu_time, "Seconds of processor time of all its threads together")
      ->default_str("--job-timeout, for each of its threads");
  add("--job-memory", limits.memory, "Bytes of memory")
      ->default_str("its share of three quarters of what there is");
  add("--job-file-size", limits.file_size, "Bytes of a file that it writes");
  add("--job-open-files", limits.open_files, "Files that it may have open");
  app.add_flag("!--no-confinement", limits.confined, "A bake may use all files that its user may")
      ->group("Limits of a bake (0: none)");
}

// What a scene may ask for, which the program that bakes holds it to.
struct SceneLimit {
  const char* flag;
  std::uint64_t value;
  const char* means;
};
using SceneLimits = std::array<SceneLimit, 4>;

void AddSceneLimits(CLI::App& app, SceneLimits& limits) {
  for (SceneLimit& limit : limits) {
    app.add_option(limit.flag, limit.value, limit.means)->capture_default_str()->group("Limits of a scene");
  }
}

// What a service that faces others needs.
void AddClients(CLI::App& app, std::string& tokens, bool& insecure, std::set<std::string>& origins) {
  app.add_option_function<std::vector<std::string>>(
         "--allow-origin",
         [&origins](const std::vector<std::string>& given) {
           for (const std::string& origin : given) {
             if (!radbake::server::IsOrigin(origin)) {
               throw CLI::ValidationError("--allow-origin",
                                          "takes scheme://host[:port], as https://example.org");
             }
             origins.insert(origin);
           }
         },
         "An origin whose pages may use the service from a browser; again for another")
      ->allow_extra_args(false);
  app.add_option("--tokens", tokens,
                 "A file of clients: a line is a name and the SHA-256 of its bearer token");
  app.add_flag("--insecure", insecure, "Listen to other machines without tokens");
}

// Which part of the service this process is, and where its queue is.
void AddQueue(CLI::App& app, Jobs::Options& options, std::string& timeout, std::string& lease) {
  using radbake::server::Role;
  app.add_option(
      "--database", options.database,
      "postgresql://…: the queue and all files are there, for any number of radbaked (its password is "
      "best in PGPASSWORD or PGPASSFILE; default: SQLite in the folder of the jobs)");
  app.add_option("--database-timeout", timeout,
                 "How long PostgreSQL may take to answer: after that a request gets a 503")
      ->capture_default_str();
  app.add_option(
         "--role", options.role,
         "api: takes uploads and answers for all jobs; worker: bakes, and answers /healthz, /readyz and "
         "/metrics; all: both")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, Role>{{"all", Role::kAll}, {"api", Role::kApi}, {"worker", Role::kWorker}}))
      ->default_str("all");
  app.add_option("--lease", lease, "How long a worker may be silent before its jobs are others'")
      ->capture_default_str();
}

sigset_t StopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

// The shell's usual limit is for programs that have few files open.
void AllowOpenFiles(const HttpServer::Options& http, int workers) {
  constexpr std::size_t kOfTheRest = 64;
  constexpr std::size_t kOfABake = 8;
  const radbake::server::HttpLimits& limits = http.limits;
  const std::size_t needed = limits.connections + limits.uploads + limits.downloads +
                             kOfABake * static_cast<std::size_t>(workers) + kOfTheRest;
  rlimit limit{};
  ::getrlimit(RLIMIT_NOFILE, &limit);
  limit.rlim_cur = std::max(limit.rlim_cur, std::min<rlim_t>(limit.rlim_max, needed));
  ::setrlimit(RLIMIT_NOFILE, &limit);
  if (limit.rlim_cur < needed) {
    spdlog::warn("this process may open {} files, and --max-connections {} needs {}", limit.rlim_cur,
                 limits.connections, needed);
  }
}

// Without a trace: what the folder of the jobs lacks to be used.
void CheckData(const std::filesystem::path& data) {
  std::filesystem::path folder = data;
  while (!std::filesystem::exists(folder) && folder.has_relative_path()) {
    folder = folder.parent_path();
  }
  if (!std::filesystem::is_directory(folder) || ::access(folder.c_str(), R_OK | W_OK | X_OK) != 0) {
    throw std::runtime_error("--data: " + folder.string() + " is no folder that this user may write to");
  }
}

void Serve(const std::filesystem::path& data, const Jobs::Options& options, const HttpServer::Options& http) {
  const sigset_t signals = StopSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);  // for every thread to come
  AllowOpenFiles(http, options.workers.count);
  Jobs jobs(data, options);
  HttpServer server(jobs, http);
  std::printf("listening on %s\n", server.Url().c_str());
  std::fflush(stdout);
  spdlog::info("radbaked {}: {} at a time, in {}", RADBAKE_VERSION, options.workers.count, data.string());
  std::thread listener([&] {
    if (!server.Listen()) {
      spdlog::error("the port is lost");
      ::kill(::getpid(), SIGTERM);
    }
  });
  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("stopping");
  jobs.Retire();
  server.Stop();
  listener.join();
}

}  // namespace

int main(int argc, char** argv) {
  OpenStandardDescriptors();
  HideMemory();
  radbake::server::StartLog();
  const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
  HttpServer::Options http;
  Jobs::Options options;
  radbake::server::Workers::Options& workers = options.workers;
  workers.count = static_cast<int>(std::max(1U, cores / 2));
  std::string listen = "127.0.0.1:8080";
  std::string data;
  std::string radbake = (std::filesystem::read_symlink("/proc/self/exe").parent_path() / "radbake").string();
  CLI::App app{"radbaked: bakes glTF scenes for whoever asks over HTTP", "radbaked"};
  app.set_version_flag("--version", "radbaked " RADBAKE_VERSION);
  app.add_option("--listen", listen, "HOST:PORT; port 0: any free one")->capture_default_str();
  app.add_option("--data", data, "The folder of the jobs (default: radbake in the user's state folder)");
  app.add_option("--workers", workers.count, "Bakes at a time")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  app.add_option("--radbake", radbake, "The program that bakes")->capture_default_str();
  AddLimits(app, http.limits);
  AddChildLimits(app, workers.limits);
  const radbake::gltf::Limits scene;
  SceneLimits scene_limits = {
      {{"--max-triangles", scene.triangles, "Triangles and primitives"},
       {"--max-nodes", scene.nodes, "Nodes"},
       {"--max-json-depth", scene.json_depth, "Levels that its JSON may be nested"},
       {"--max-texture-pixels", scene.texture_pixels, "Pixels of all images together"}}};
  AddSceneLimits(app, scene_limits);
  std::string tokens;
  bool insecure = false;
  AddClients(app, tokens, insecure, http.origins);
  bool check_config = false;
  app.add_flag("--check-config", check_config, "Say what is wrong with the flags and their files, and exit");
  options.least_free = 256ULL << 20U;
  app.add_option("--least-free", options.least_free, "Bytes of the disk below which /readyz says no")
      ->capture_default_str();
  std::string database_timeout = "5s";
  std::string lease = "15s";
  AddQueue(app, options, database_timeout, lease);
  std::string keep = "24h";
  std::string grace = "10s";
  app.add_option("--grace", grace, "How long running bakes may go on when the service is stopped")
      ->capture_default_str();
  app.add_option("--keep", keep, "How long ended jobs are kept: 90s, 30m, 24h, 7d")->capture_default_str();
  try {
    app.parse(argc, argv);
    options.keep = ParseDuration("--keep", keep);
    workers.grace = ParseDuration("--grace", grace);
    workers.lease = ParseDuration("--lease", lease);
    options.database_timeout = ParseDuration("--database-timeout", database_timeout);
    workers.beat = std::min<std::chrono::milliseconds>(workers.beat, workers.lease / 5);
    if (workers.lease < std::chrono::seconds(1)) {
      throw CLI::ValidationError("--lease", "takes a second or more");
    }
    if (options.database_timeout < std::chrono::seconds(1) ||
        options.database_timeout > std::chrono::hours(1)) {
      throw CLI::ValidationError("--database-timeout", "takes a second to an hour");
    }
    ParseListen(listen, http);
    if (!IsLoopback(http.host) && tokens.empty() && !insecure) {
      throw CLI::ValidationError("--listen",
                                 "names an address that other machines reach: --tokens says who may "
                                 "use it, --insecure that everybody may");
    }
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    workers.threads = static_cast<int>(std::max(1U, cores / static_cast<unsigned>(workers.count)));
    if (app.count("--job-cpu-time") == 0) {
      workers.limits.cpu_time = workers.limits.time * workers.threads;
    }
    if (app.count("--job-memory") == 0) {
      workers.limits.memory =
          radbake::server::MemoryBytes() / 4 * 3 / static_cast<std::uint64_t>(workers.count);
    }
    workers.radbake = std::filesystem::absolute(radbake);
    for (const SceneLimit& limit : scene_limits) {
      workers.flags.insert(workers.flags.end(), {limit.flag, std::to_string(limit.value)});
    }
    if (::access(workers.radbake.c_str(), X_OK) != 0) {
      throw std::runtime_error("there is no program " + radbake + ": --radbake says where it is");
    }
    if (!options.database.empty()) {
      const radbake::server::PostgresQueue checked(options.database);  // connects to nothing
    }
    if (!tokens.empty()) {
      http.tokens = std::make_shared<const radbake::server::Tokens>(radbake::server::Tokens::Read(tokens));
    }
    if (workers.limits.confined && !radbake::server::Sandbox::CanConfine()) {
      spdlog::warn("this kernel has no Landlock: bakes may read and write whatever this user may");
    }
    const std::filesystem::path folder = data.empty() ? DefaultData() : std::filesystem::absolute(data);
    if (check_config) {
      CheckData(folder);
      std::puts("radbaked: the configuration can be used");
      return 0;
    }
    Serve(folder, options, http);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "radbaked: %s\n", error.what());
    return check_config ? 2 : 1;
  }
}
