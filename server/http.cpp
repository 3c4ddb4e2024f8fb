#include "server/http.h"

#include <httplib.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <type_traits>
#include <utility>

#include "server/http_endpoints.h"
#include "server/http_front.h"
#include "server/http_origin.h"
#include "server/log.h"
#include "server/places.h"
#include "server/problem.h"
#include "server/stop_signal.h"

namespace radbake::server {
namespace {

using httplib::ContentReader;
using httplib::Request;
using httplib::Response;

constexpr std::size_t kThreads = 8;  // beside those that may wait for a client
constexpr int kBacklog = 512;
constexpr std::chrono::seconds kStopPatience{5};  // with clients, when the server stops

// The queue's database is away, or there is no room on the disk or no right to write to it.
bool Storeless(const std::exception& error) {
  const auto* const refused = dynamic_cast<const std::system_error*>(&error);
  return dynamic_cast<const QueueError*>(&error) != nullptr ||
         (refused != nullptr &&
          (refused->code() == std::errc::no_space_on_device ||
           refused->code() == std::errc::read_only_file_system || refused->code().value() == EDQUOT));
}

// What its listener would hand to threads is done at once: it only hands the socket to the front.
class AtOnce final : public httplib::TaskQueue {
 public:
  using Result = decltype(std::declval<httplib::TaskQueue&>().enqueue(std::declval<std::function<void()>>()));
  Result enqueue(std::function<void()> task) override {  // NOLINT(readability-identifier-naming)
    task();
    return static_cast<Result>(true);
  }
  void shutdown() override {}  // NOLINT(readability-identifier-naming)
};

// The threads that answer requests.
class Pool {
 public:
  explicit Pool(std::size_t threads) : pool_(threads) {}
  ~Pool() { ShutDown(); }
  void Enqueue(std::function<void()> task) { pool_.enqueue(std::move(task)); }
  // Ends when there is nothing more to do; a task may still add another.
  void ShutDown() {
    if (!std::exchange(down_, true)) {
      pool_.shutdown();
    }
  }

 private:
  httplib::ThreadPool pool_;
  bool down_ = false;
};

// What becomes a label: a client may make up any method.
bool IsKnown(const std::string& method) {
  static const std::set<std::string> kMethods = {"GET",   "HEAD",   "POST",    "PUT",
                                                 "PATCH", "DELETE", "OPTIONS", "TRACE"};
  return kMethods.contains(method);
}

// httplib's server, with our own way from an accepted socket to a request.
class Listener : public httplib::Server {
 public:
  explicit Listener(std::function<void(int)> accepted) : accepted_(std::move(accepted)) {
    new_task_queue = [] { return new AtOnce; };
  }

  // The backlog that is compiled into the library is 5: a burst of clients would wait for retransmissions.
  bool Widen() { return ::listen(svr_sock_, kBacklog) == 0; }

  // Reads the request, has it answered by the handlers, and writes the answer.
  void Process(Connection& connection) {
    bool closed = true;
    const auto process = [&](auto& self) {
      // Since 0.16 the addresses are asked for beforehand.
      if constexpr (requires { self.process_request(connection, true, closed, nullptr); }) {
        self.process_request(connection, true, closed, nullptr);
      } else {
        std::string address;
        int port = 0;
        connection.get_remote_ip_and_port(address, port);
        self.process_request(connection, address, port, "", 0, true, closed, nullptr);
      }
    };
    process(*this);
  }

 private:
  bool process_and_close_socket(socket_t socket) override {  // NOLINT(readability-identifier-naming)
    accepted_(socket);
    return true;
  }

  std::function<void(int)> accepted_;
};

}  // namespace

class HttpServer::Implementation {
 public:
  Implementation(Jobs& jobs, const Options& options)
      : options_(options),
        slow_(options.limits.downloads),
        pool_(kThreads + options.limits.uploads + options.limits.downloads),
        listener_([this](int socket) { front_.Take(socket); }),
        front_(options.limits, [this](Incoming incoming) { Enqueue(std::move(incoming)); }),
        watchers_(jobs, options.limits, [this](Incoming incoming) { Enqueue(std::move(incoming)); }),
        endpoints_(jobs, watchers_, options.limits, options.tokens, [this] { return front_.connections(); }),
        origins_(options.origins),
        metrics_(jobs.metrics()) {
    using Handled = httplib::Server::HandlerResponse;
    listener_.set_tcp_nodelay(true);
    // Not SO_REUSEPORT, with which two servers could share a port without a word.
    listener_.set_socket_options([](int socket) {
      const int on = 1;
      ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    });
    listener_.set_default_headers({{"X-Content-Type-Options", "nosniff"}, {"Cache-Control", "no-store"}});

    listener_.set_expect_100_continue_handler([this](const Request& request, Response& response) {
      try {
        endpoints_.Check(request);
        return 100;
      } catch (const ProblemError& error) {
        Refuse(request, response, error.problem());
        return response.status;
      }
    });
    listener_.set_pre_routing_handler([this](const Request& request, Response& response) {
      const bool reads_body = request.method == "POST" || request.method == "PUT" ||
                              request.method == "PATCH" || request.method == "DELETE";
      if (reads_body) {
        return Handled::Unhandled;
      }
      if (origins_.IsPreflight(request)) {
        origins_.AnswerPreflight(request, response);
      } else {
        Dispatch(request, response, nullptr);
      }
      return Handled::Handled;
    });
    const auto handle = [this](const Request& request, Response& response, const ContentReader& reader) {
      Dispatch(request, response, &reader);
    };
    listener_.Post(".*", handle).Put(".*", handle).Patch(".*", handle).Delete(".*", handle);
    // What the library refuses by itself.
    listener_.set_error_handler(httplib::Server::Handler([](const Request&, Response& response) {
      if (response.body.empty()) {
        Answer(response, HttpProblem(response.status, "the request could not be read"));
      }
    }));
    listener_.set_exception_handler([](const Request&, Response& response, const std::exception_ptr&) {
      Answer(response, HttpProblem(500, "the server failed on this request"));
    });
    listener_.set_post_routing_handler([this](const Request& request, Response& response) {
      response.set_header(kRequestId,
                          request.has_header(kRequestId) ? request.get_header_value(kRequestId) : RandomId());
      origins_.Allow(request, response);
      if (!response.has_header("Content-Disposition")) {
        response.headers.erase("Accept-Ranges");  // which the library promises of all that HEAD asks for
      }
      if (response.status == 204 || response.status == 304) {
        response.headers.erase("Content-Length");
      }
    });
    listener_.set_logger([this](const Request& request, const Response& response) {
      if (current->then.kind != Then::Kind::kHold) {
        Tell(request, response);
      }
    });

    if (options.port == 0) {
      port_ = listener_.bind_to_any_port(options.host);
    } else {
      port_ = listener_.bind_to_port(options.host, options.port) ? options.port : -1;
    }
    if (port_ < 0 || !listener_.Widen()) {
      throw std::runtime_error("cannot listen on " + options.host + ":" + std::to_string(options.port));
    }
  }

  ~Implementation() { ShutDown(); }
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;

  std::string Url() const {
    const bool v6 = options_.host.find(':') != std::string::npos;
    return "http://" + (v6 ? "[" + options_.host + "]" : options_.host) + ":" + std::to_string(port_);
  }
  int port() const { return port_; }

  bool Listen() {
    const bool stopped = listener_.listen_after_bind();
    over_ = true;
    ShutDown();
    return stopped;
  }

  void Stop() {
    stopping_ = true;
    // httplib forgets a stop() that comes before it has begun to listen.
    while (!listener_.is_running() && !over_) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    listener_.stop();
  }

 private:
  // The connection whose request this thread is at, and what becomes of it after the answer.
  struct Task {
    Connection& connection;
    Then then;
    std::chrono::steady_clock::time_point begin;
  };
  static inline thread_local Task* current = nullptr;

  // Tasks must be copyable. Whether this process lives is told also where all others wait for the database.
  void Enqueue(Incoming incoming) {
    const bool at_once =
        incoming.bytes.starts_with("GET /healthz") || incoming.bytes.starts_with("HEAD /healthz");
    auto shared = std::make_shared<Incoming>(std::move(incoming));
    (at_once ? health_ : pool_).Enqueue([this, shared] { Process(std::move(*shared)); });
  }

  void Process(Incoming incoming) {
    const std::optional<Problem> refused = std::move(incoming.refused);
    const bool head_alone = incoming.bytes.starts_with("HEAD ");
    Connection connection(std::move(incoming), options_.limits, slow_, break_off_);
    if (refused) {
      WriteRefusal(connection, *refused, head_alone);
      front_.Linger(connection.TakeSocket());
      return;
    }
    Task task{connection, {}, std::chrono::steady_clock::now()};
    current = &task;
    listener_.Process(connection);
    current = nullptr;
    metrics_.CountReceived(connection.received());
    metrics_.CountSent(connection.sent());
    Then& then = task.then;
    if (then.kind == Then::Kind::kWatch) {
      watchers_.Watch(std::move(then.place), connection.TakeSocket(), then.job, then.last);
    } else if (then.kind == Then::Kind::kHold) {
      watchers_.Hold(std::move(then.place), {connection.TakeSocket(), then.request, std::nullopt}, then.job,
                     then.deadline);
    } else if (!connection.heard()) {
      front_.Linger(connection.TakeSocket());
    }
  }

  // Counts and logs an answer.
  void Tell(const Request& request, const Response& response) {
    const bool held_post = IsHeldPost(request);
    const std::string method = held_post ? "POST" : request.method;
    const Target target = ParsePath(held_post ? "/v1/bakes" : request.path);
    metrics_.CountRequest(Route(target.resource), IsKnown(method) ? method : "other", response.status);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - current->begin;
    const LogScope scope({{"request", response.get_header_value(kRequestId)},
                          {"method", method},
                          {"target", held_post ? "/v1/bakes" : request.target},
                          {"status", response.status},
                          {"seconds", seconds.count()}});
    const std::string made = response.get_header_value("Location");
    const std::string job = target.id.empty() ? made.substr(made.rfind('/') + 1) : target.id;
    if (job.empty()) {
      spdlog::info("answered");
    } else {
      const LogScope of_job({{"job", job}});
      spdlog::info("answered");
    }
  }

  // Without the library, which gets to see only whole heads.
  void WriteRefusal(Connection& connection, const Problem& problem, bool head_alone) {
    const std::string id = RandomId();
    const LogScope scope({{"request", id}, {"status", problem.status}});
    spdlog::info("refused: {}", problem.detail);
    metrics_.CountRequest(Route(Resource::kNone), "other", problem.status);
    const std::string body = ToText(ToJson(problem));
    const std::string answer =
        "HTTP/1.1 " + std::to_string(problem.status) + " " + problem.title +
        "\r\nContent-Type: application/problem+json\r\nX-Content-Type-Options: nosniff\r\nCache-Control: "
        "no-store\r\nConnection: close\r\n" +
        kRequestId + ": " + id + "\r\n" + (problem.status == 503 ? "Retry-After: 1\r\n" : "") +
        "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" + (head_alone ? "" : body);
    connection.write(answer.data(), answer.size());  // shorter than any socket's buffer
    metrics_.CountReceived(connection.received());
    metrics_.CountSent(connection.sent());
  }

  void Dispatch(const Request& request, Response& response, const ContentReader* reader) {
    const LogScope scope({{"request", request.get_header_value(kRequestId)}});
    Body body(request, reader, current->connection, stopping_);
    try {
      current->then = endpoints_.Serve(request, response, current->connection, body);
      if (current->then.kind == Then::Kind::kHold) {
        current->connection.Mute();
      }
    } catch (const ProblemError& error) {
      Refuse(request, response, error.problem());
    } catch (const std::exception& error) {
      spdlog::error("{} {}: {}", request.method, Quoted(request.target), error.what());
      Answer(response, Storeless(error)
                           ? HttpProblem(503, "the service cannot read or write its jobs at the moment")
                           : HttpProblem(500, "the server failed on this request"));
    }
  }

  // Nothing new comes in; what has come is answered, unless its client lets it wait for too long.
  void ShutDown() {
    front_.Stop();
    watchers_.Stop();
    std::promise<void> done;
    std::thread patience([this, answered = done.get_future()] {
      if (answered.wait_for(kStopPatience) == std::future_status::timeout) {
        break_off_.Raise();
      }
    });
    pool_.ShutDown();
    health_.ShutDown();
    done.set_value();
    patience.join();
  }

  Options options_;
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> over_ = false;
  int port_ = -1;
  StopSignal break_off_;
  Places slow_;
  Pool pool_;
  Pool health_{1};
  Listener listener_;
  Front front_;
  Watchers watchers_;
  Endpoints endpoints_;
  Origins origins_;
  Metrics& metrics_;
};

HttpServer::HttpServer(Jobs& jobs, const Options& options)
    : implementation_(std::make_unique<Implementation>(jobs, options)) {}

HttpServer::~HttpServer() = default;

std::string HttpServer::Url() const {
  return implementation_->Url();
}

int HttpServer::port() const {
  return implementation_->port();
}

bool HttpServer::Listen() {
  return implementation_->Listen();
}

void HttpServer::Stop() {
  implementation_->Stop();
}

}  // namespace radbake::server
