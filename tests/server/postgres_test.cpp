#include "tests/server/postgres_test.h"

#include <fcntl.h>
#include <grp.h>
#include <libpq-fe.h>
#include <pwd.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <vector>

namespace radbake::server {
namespace {

struct ConnectionCloser {
  void operator()(PGconn* connection) const { PQfinish(connection); }
};
struct ResultClearer {
  void operator()(PGresult* result) const { PQclear(result); }
};

std::filesystem::path Programs() {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(::popen("pg_config --bindir", "r"), ::pclose);
  std::array<char, 4096> line{};
  if (pipe == nullptr || std::fgets(line.data(), line.size(), pipe.get()) == nullptr) {
    throw std::runtime_error("there is no pg_config");
  }
  std::string path(line.data());
  path.erase(path.find_last_not_of('\n') + 1);
  return path;
}

// PostgreSQL runs as no root.
const passwd* ServerUser() {
  const passwd* user = ::geteuid() == 0 ? ::getpwnam("postgres") : nullptr;
  if (::geteuid() == 0 && user == nullptr) {
    throw std::runtime_error("there is no user postgres");
  }
  return user;
}

pid_t Launch(std::vector<std::string> words) {
  const passwd* const user = ServerUser();
  std::vector<char*> arguments;
  for (std::string& word : words) {
    arguments.push_back(word.data());
  }
  arguments.push_back(nullptr);
  const pid_t parent = ::getpid();
  const pid_t pid = ::fork();
  if (pid == 0) {
    if (user != nullptr &&
        (::setgroups(0, nullptr) != 0 || ::setgid(user->pw_gid) != 0 || ::setuid(user->pw_uid) != 0)) {
      ::_exit(127);
    }
    ::prctl(PR_SET_PDEATHSIG, SIGQUIT);  // at which it ends at once, with its processes
    if (::getppid() != parent || ::chdir("/") != 0) {
      ::_exit(127);
    }
    const int null = ::open("/dev/null", O_RDWR);
    for (const int descriptor : {0, 1, 2}) {
      ::dup2(null, descriptor);
    }
    ::execv(arguments[0], arguments.data());
    ::_exit(127);
  }
  return pid;
}

std::vector<pid_t> Children(pid_t parent) {
  std::vector<pid_t> children;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const pid_t process = std::atoi(entry.path().filename().c_str());
    std::ifstream status(entry.path() / "status");
    for (std::string word; process > 0 && status >> word;) {
      pid_t of = 0;
      if (word == "PPid:" && status >> of && of == parent) {
        children.push_back(process);
      }
    }
  }
  return children;
}

std::string Url(const std::filesystem::path& folder, const std::string& database) {
  return "postgresql:///" + database + "?user=radbake&host=" + folder.string();
}

}  // namespace

std::string RunSql(const std::string& url, const std::string& sql) {
  const std::unique_ptr<PGconn, ConnectionCloser> connection(PQconnectdb(url.c_str()));
  const std::unique_ptr<PGresult, ResultClearer> result(PQexec(connection.get(), sql.c_str()));
  const ExecStatusType status = PQresultStatus(result.get());
  if (status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK) {
    throw std::runtime_error(PQerrorMessage(connection.get()));
  }
  return PQntuples(result.get()) > 0 ? PQgetvalue(result.get(), 0, 0) : "";
}

PostgresServer::PostgresServer() {
  std::string name = (std::filesystem::temp_directory_path() / "radbaked-pg-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) {
    throw std::system_error(errno, std::generic_category(), "mkdtemp");
  }
  folder_ = name;
  if (const passwd* const user = ServerUser();
      user != nullptr && ::chown(name.c_str(), user->pw_uid, user->pw_gid) != 0) {
    throw std::system_error(errno, std::generic_category(), "chown");
  }
  const pid_t pid = Launch({(Programs() / "initdb").string(), "-D", (folder_ / "data").string(), "-U",
                            "radbake", "-A", "trust", "-E", "UTF8", "--locale=C", "--no-sync"});
  int status = -1;
  if (::waitpid(pid, &status, 0) != pid || status != 0) {
    throw std::runtime_error("initdb has failed");
  }
  Start();
}

PostgresServer::~PostgresServer() {
  Kill();
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

PostgresServer& PostgresServer::Shared() {
  static PostgresServer server;
  return server;
}

void PostgresServer::Start() {
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (PQping(Url(folder_, "postgres").c_str()) != PQPING_OK) {
    // It refuses to start as long as a process of a killed one is left.
    if (pid_ < 0 || ::waitpid(pid_, nullptr, WNOHANG) != 0) {
      // It writes nothing through, since no test takes the machine's power: what a killed one wrote is there.
      pid_ = Launch({(Programs() / "postgres").string(), "-D", (folder_ / "data").string(), "-k",
                     folder_.string(), "-c", "listen_addresses=", "-c", "fsync=off", "-c",
                     "shared_buffers=16MB"});
    }
    if (std::chrono::steady_clock::now() > end) {
      throw std::runtime_error("PostgreSQL does not start");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

void PostgresServer::Halt() {
  // First the one that makes the others.
  halted_ = {pid_};
  ::kill(pid_, SIGSTOP);
  for (const pid_t child : Children(pid_)) {
    halted_.push_back(child);
    ::kill(child, SIGSTOP);
  }
}

void PostgresServer::Resume() {
  for (const pid_t process : halted_) {
    ::kill(process, SIGCONT);
  }
  halted_.clear();
}

void PostgresServer::Kill() {
  Resume();  // without their parent, the others end when they go on
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }
}

std::string PostgresServer::MakeDatabase() {
  const std::string name = "test" + std::to_string(++databases_);
  RunSql(Url(folder_, "postgres"), "CREATE DATABASE " + name);
  return Url(folder_, name);
}

}  // namespace radbake::server
