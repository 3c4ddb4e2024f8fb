#include "tests/server/service_test.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <mutex>
#include <sstream>
#include <stdexcept>
#include <system_error>

namespace radbake::server {
namespace {

std::string Lower(std::string text) {
  for (char& c : text) {
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return text;
}

Answer ParseAnswer(const std::string& text) {
  Answer answer;
  const std::size_t head_end = text.find("\r\n\r\n");
  if (head_end == std::string::npos || !text.starts_with("HTTP/1.1 ")) {
    return answer;
  }
  answer.status = std::atoi(text.c_str() + 9);
  answer.body = text.substr(head_end + 4);
  std::istringstream head(text.substr(0, head_end));
  std::string line;
  std::getline(head, line);
  while (std::getline(head, line)) {
    const std::size_t colon = line.find(": ");
    line.erase(line.find_last_not_of('\r') + 1);
    answer.headers[Lower(line.substr(0, colon))] = line.substr(colon + 2);
  }
  return answer;
}

Jobs::Options ToJobs(const std::filesystem::path& radbake, const Service::Options& options) {
  Jobs::Options jobs;
  jobs.workers.radbake = radbake;
  jobs.workers.count = options.workers;
  jobs.workers.limits = options.child_limits;
  jobs.keep = options.keep;
  jobs.least_free = options.least_free;
  jobs.role = options.role;
  return jobs;
}

// Requests and jobs are logged; a test's own output is not to be found among that.
const bool kQuiet = (spdlog::set_level(spdlog::level::off), true);

}  // namespace

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "radbaked-test-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) {
    throw std::runtime_error("mkdtemp");
  }
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::string ReadFile(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

void WriteFile(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

std::vector<std::string> ListTree(const std::filesystem::path& folder) {
  std::vector<std::string> paths;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    paths.push_back(entry.path().lexically_relative(folder).string());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

bool Eventually(const std::function<bool()>& done) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (std::chrono::steady_clock::now() < end) {
    if (done()) {
      return true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

std::filesystem::path WriteProgram(const std::filesystem::path& path, const std::string& script) {
  WriteFile(path, "#!/bin/sh\n" + script);
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  return path;
}

Descriptor Connect(int port, const std::string& bytes) {
  Descriptor connection(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(connection.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return {};
  }
  for (std::size_t sent = 0; sent < bytes.size();) {
    const ssize_t count = ::send(connection.get(), bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (count <= 0) {
      break;  // it has answered already
    }
    sent += static_cast<std::size_t>(count);
  }
  return connection;
}

bool ReceiveUntil(const Descriptor& connection, const std::string& end, std::string& text) {
  const timeval minute{60, 0};
  ::setsockopt(connection.get(), SOL_SOCKET, SO_RCVTIMEO, &minute, sizeof minute);
  while (text.find(end) == std::string::npos) {
    std::array<char, 65536> buffer{};
    const ssize_t count = ::recv(connection.get(), buffer.data(), buffer.size(), 0);
    if (count <= 0) {
      return false;
    }
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
  return true;
}

namespace {

// Of a service that was killed between the head and the body, say. RFC 9112 section 8: the message is
// incomplete.
bool IsCutShort(const std::string& request, const Answer& answer) {
  const auto length = answer.headers.find("content-length");
  const bool has_body = !request.starts_with("HEAD ") && answer.status != 204 && answer.status != 304;
  return has_body && length != answer.headers.end() && answer.body.size() < std::stoull(length->second);
}

void Record(const std::string& request, const Answer& answer) {
  const char* folder = std::getenv("RADBAKED_ANSWERS");
  if (folder == nullptr || answer.status == 0) {
    return;
  }
  std::istringstream line(request.substr(0, request.find("\r\n")));
  std::string method;
  std::string target;
  line >> method >> target;
  const nlohmann::json record = {{"method", method},
                                 {"target", target},
                                 {"status", answer.status},
                                 {"headers", answer.headers},
                                 {"body", answer.body}};
  static std::mutex mutex;  // some tests have many clients
  const std::lock_guard lock(mutex);
  std::filesystem::create_directories(folder);
  std::ofstream(std::filesystem::path(folder) / (std::to_string(::getpid()) + ".jsonl"), std::ios::app)
      << record.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) << "\n";
}

}  // namespace

Answer Receive(const Descriptor& connection, const std::string& request) {
  const timeval patience{120, 0};
  ::setsockopt(connection.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  std::string text;
  std::array<char, 65536> buffer{};
  for (ssize_t count = 0; (count = ::recv(connection.get(), buffer.data(), buffer.size(), 0)) > 0;) {
    text.append(buffer.data(), static_cast<std::size_t>(count));
  }
  Answer answer = ParseAnswer(text);
  if (IsCutShort(request, answer)) {
    return {};
  }
  Record(request, answer);
  return answer;
}

Answer Send(int port, const std::string& bytes) {
  return Receive(Connect(port, bytes), bytes);
}

Answer Client::Request(const std::string& method, const std::string& path, const std::string& headers,
                       const std::string& body) const {
  return Send(port_, method + " " + path + " HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n" + body);
}

Answer Client::Post(const std::string& body, const std::string& type) const {
  return Request("POST", "/v1/bakes",
                 "Content-Type: " + type + "\r\nContent-Length: " + std::to_string(body.size()) + "\r\n",
                 body);
}

Answer Client::PostForm(const std::vector<FormPart>& parts) const {
  std::string body;
  for (const FormPart& part : parts) {
    body += "--border\r\nContent-Disposition: form-data; name=\"" + part.name + "\"";
    body += part.filename.empty() ? "" : "; filename=\"" + part.filename + "\"";
    body += "\r\n\r\n" + part.content + "\r\n";
  }
  return Post(body + "--border--\r\n", "multipart/form-data; boundary=border");
}

std::string Client::PostScene() const {
  const Answer answer = Post(Glb(), "model/gltf-binary");
  EXPECT_EQ(answer.status, 202) << answer.body;
  return answer.headers.contains("location") ? answer.headers.at("location") : "";
}

nlohmann::json Client::WaitFor(const std::string& job, const std::string& status) const {
  nlohmann::json seen;
  EXPECT_TRUE(Eventually([&] {
    const Answer answer = Get(job);
    seen = answer.Json();
    return answer.status == 200 && seen.at("status") == status;
  })) << "is not "
      << status << ", but " << seen;
  return seen;
}

std::string Glb(const std::string& rest) {
  const auto size = static_cast<std::uint32_t>(12 + rest.size());
  std::string glb = {'g', 'l', 'T', 'F', 2, 0, 0, 0};
  for (unsigned shift = 0; shift < 32; shift += 8) {
    glb += static_cast<char>((size >> shift) & 0xFFU);
  }
  return glb + rest;
}

HttpLimits Service::SmallLimits() {
  HttpLimits limits;
  limits.upload = 1 << 20;
  return limits;
}

Service::Service(const std::filesystem::path& data, const std::filesystem::path& radbake,
                 const Options& options)
    : jobs_(data, ToJobs(radbake, options)),
      server_(jobs_, {"127.0.0.1", 0, options.limits,
                      options.tokens.empty() ? nullptr : std::make_shared<const Tokens>(options.tokens),
                      options.origins}),
      listener_([this] { server_.Listen(); }) {}

Service::~Service() {
  server_.Stop();
  listener_.join();
}

Daemon::Daemon(const std::filesystem::path& data, const std::filesystem::path& radbake,
               const std::vector<std::string>& more)
    : log_(data.string() + ".log") {
  std::vector<std::string> words = {RADBAKE_BINARY_DIR "/radbaked"};
  words.insert(words.end(), {"--data", data.string(), "--radbake", radbake.string(), "--no-confinement"});
#if defined(RADBAKE_ADDRESS_SANITIZER) || defined(RADBAKE_THREAD_SANITIZER)
  words.insert(words.end(), {"--job-memory", "0"});  // as which its shadow counts
#endif
  words.insert(words.end(), more.begin(), more.end());
  if (std::find(more.begin(), more.end(), "--listen") == more.end()) {
    words.insert(words.end(), {"--listen", "127.0.0.1:0"});
  }
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words) {
    arguments.push_back(word.data());
  }
  arguments.push_back(nullptr);
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
    throw std::runtime_error("pipe2");
  }
  const Descriptor output(ends[0]);
  Descriptor output_end(ends[1]);
  const Descriptor log(::open(log_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600));
  pid_ = ::fork();
  if (pid_ == 0) {
    ::dup2(log.get(), STDERR_FILENO);
    ::dup2(output_end.get(), STDOUT_FILENO);
    ::execv(arguments[0], arguments.data());
    ::_exit(127);
  }
  output_end.Close();
  std::string line;
  for (char c = 0; ::read(output.get(), &c, 1) == 1 && c != '\n';) {
    line += c;
  }
  const std::string expected = "listening on http://127.0.0.1:";
  port_ = line.starts_with(expected) ? std::atoi(line.c_str() + expected.size()) : 0;
}

Daemon::~Daemon() {
  End(SIGKILL);
}

std::string Daemon::Log() const {
  return ReadFile(log_);
}

void Daemon::Signal(int signal) const {
  ::kill(pid_, signal);
}

int Daemon::End(int signal) {
  if (pid_ < 0) {
    return 0;
  }
  int status = 0;
  ::kill(pid_, signal);
  ::waitpid(pid_, &status, 0);
  pid_ = -1;
  return WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status);
}

}  // namespace radbake::server
