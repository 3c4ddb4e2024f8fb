#include "server/http.h"

#include <fcntl.h>
#include <httplib.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <exception>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "server/http_request.h"
#include "server/multipart.h"
#include "server/problem.h"
#include "server/upload.h"

namespace radbake::server {
namespace {

using httplib::ContentReader;
using httplib::Request;
using httplib::Response;
using std::chrono::seconds;

constexpr std::size_t kThreads = 32;
constexpr int kBacklog = 512;
constexpr seconds kReadTimeout{10};
constexpr seconds kWriteTimeout{10};
void Answer(Response& response, const Problem& problem) {
  response.status = problem.status;
  response.set_content(ToText(ToJson(problem)), "application/problem+json");
}

void SetRetryAfter(Response& response, const Job& job) {
  if (!Ended(job.status)) {
    response.set_header("Retry-After", "1");
  }
}

void Answer(Response& response, int status, const JobView& view) {
  response.status = status;
  response.set_content(ToText(ToJson(view)), "application/json");
  SetRetryAfter(response, view.job);
}

void Refuse(const Request& request, Response& response, const Problem& problem) {
  Answer(response, problem);
  if (problem.status == 405) {
    response.set_header("Allow", std::string(Allowed(ParsePath(request.path).resource)));
  }
}

ProblemError UnknownJob() {
  return ProblemError(HttpProblem(404, "there is no such job"));
}

// Streams a file of a job that has succeeded.
void SendResult(Response& response, const JobView& view, const std::filesystem::path& path,
                const char* type) {
  const Job& job = view.job;
  if (job.status != Status::kSucceeded) {
    SetRetryAfter(response, job);
    const std::string reason = job.problem ? ": " + job.problem->detail : "";
    throw ProblemError(NoResult("the job is " + std::string(ToString(job.status)) + reason));
  }
  const auto file = std::make_shared<Descriptor>(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status{};
  if (!file->open() || ::fstat(file->get(), &status) != 0 || status.st_size == 0) {
    throw UnknownJob();  // deleted meanwhile
  }
  response.status = 200;
  response.set_content_provider(
      static_cast<std::size_t>(status.st_size), type,
      [file](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
        std::array<char, 65536> buffer{};
        const ssize_t count =
            ::pread(file->get(), buffer.data(), std::min(length, buffer.size()), static_cast<off_t>(offset));
        return count > 0 && sink.write(buffer.data(), static_cast<std::size_t>(count));
      });
}

class Httplib : public httplib::Server {
 public:
  // The backlog that is compiled into the library is 5: a burst of clients would wait for retransmissions.
  bool Widen() { return ::listen(svr_sock_, kBacklog) == 0; }
};

}  // namespace

class HttpServer::Implementation {
 public:
  Implementation(Jobs& jobs, const Options& options) : jobs_(jobs), options_(options) {
    using Handled = httplib::Server::HandlerResponse;
    server_.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
    server_.set_tcp_nodelay(true);
    server_.set_read_timeout(kReadTimeout);
    server_.set_write_timeout(kWriteTimeout);
    // One request a connection: idle clients hold no thread, and what is left of a body is never taken for a
    // request.
    server_.set_keep_alive_max_count(1);
    // Not SO_REUSEPORT, with which two servers could share a port without a word.
    server_.set_socket_options([](int socket) {
      const int on = 1;
      ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    });
    server_.set_default_headers({{"X-Content-Type-Options", "nosniff"}, {"Cache-Control", "no-store"}});

    server_.set_expect_100_continue_handler([this](const Request& request, Response& response) {
      try {
        CheckHead(request, options_.max_upload);
        return 100;
      } catch (const ProblemError& error) {
        Refuse(request, response, error.problem());
        return response.status;
      }
    });
    server_.set_pre_routing_handler([this](const Request& request, Response& response) {
      Disarm(const_cast<Request&>(request));  // NOLINT: the library made it, not const
      const bool reads_body = request.method == "POST" || request.method == "PUT" ||
                              request.method == "PATCH" || request.method == "DELETE";
      if (reads_body) {
        return Handled::Unhandled;
      }
      Dispatch(request, response, nullptr);
      return Handled::Handled;
    });
    const auto handle = [this](const Request& request, Response& response, const ContentReader& reader) {
      Dispatch(request, response, &reader);
    };
    server_.Post(".*", handle).Put(".*", handle).Patch(".*", handle).Delete(".*", handle);
    // What the library refuses by itself.
    server_.set_error_handler(httplib::Server::Handler([](const Request&, Response& response) {
      if (response.body.empty()) {
        Answer(response, HttpProblem(response.status, "the request could not be read"));
      }
    }));
    server_.set_exception_handler([](const Request&, Response& response, const std::exception_ptr&) {
      Answer(response, HttpProblem(500, "the server failed on this request"));
    });
    server_.set_logger([](const Request& request, const Response& response) {
      spdlog::info("{} {} {}", request.method, Quoted(request.target), response.status);
    });

    if (options.port == 0) {
      port_ = server_.bind_to_any_port(options.host);
    } else {
      port_ = server_.bind_to_port(options.host, options.port) ? options.port : -1;
    }
    if (port_ < 0 || !server_.Widen()) {
      throw std::runtime_error("cannot listen on " + options.host + ":" + std::to_string(options.port));
    }
  }

  std::string Url() const {
    const bool v6 = options_.host.find(':') != std::string::npos;
    return "http://" + (v6 ? "[" + options_.host + "]" : options_.host) + ":" + std::to_string(port_);
  }
  int port() const { return port_; }

  bool Listen() {
    const bool stopped = server_.listen_after_bind();
    over_ = true;
    return stopped;
  }

  void Stop() {
    stopping_ = true;
    // httplib forgets a stop() that comes before it has begun to listen.
    while (!server_.is_running() && !over_) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    server_.stop();
  }

 private:
  void Dispatch(const Request& request, Response& response, const ContentReader* reader) {
    Body body(request, reader, stopping_);
    try {
      CheckHead(request, options_.max_upload);
      const Target target = ParsePath(request.path);
      if (target.resource == Resource::kBakes) {
        Post(request, response, body);
      } else {
        body.Drain();
        Serve(request, response, target);
      }
    } catch (const ProblemError& error) {
      body.Drain();
      Refuse(request, response, error.problem());
    } catch (const std::exception& error) {
      spdlog::error("{} {}: {}", request.method, Quoted(request.target), error.what());
      body.Drain();
      Answer(response, HttpProblem(500, "the server failed on this request"));
    }
  }

  void Post(const Request& request, Response& response, Body& body) {
    Draft draft = jobs_.Begin();
    Upload upload(draft);
    const std::string boundary = MultipartBoundary(ContentType(request));
    if (boundary.empty()) {
      upload.BeginPart("scene", "");
      body.Read(options_.max_upload, [&](std::string_view bytes) { upload.Append(bytes); });
      upload.EndPart();
    } else {
      MultipartParser parser(
          boundary, {[&](const MultipartParser::Part& part) { upload.BeginPart(part.name, part.filename); },
                     [&](std::string_view bytes) { upload.Append(bytes); }, [&] { upload.EndPart(); }});
      body.Read(options_.max_upload, [&](std::string_view bytes) { parser.Feed(bytes); });
      parser.End();
    }
    const std::string scene = upload.Finish();
    const JobView view = jobs_.Submit(std::move(draft), scene);
    Answer(response, 202, view);
    response.set_header("Location", "/v1/bakes/" + view.job.id);
  }

  void Serve(const Request& request, Response& response, const Target& target) {
    if (target.resource == Resource::kHealth) {
      response.status = 200;
      response.set_content(R"({"status":"ok"})", "application/json");
      return;
    }
    const std::optional<JobView> view = jobs_.Find(target.id);
    if (!view) {
      throw UnknownJob();
    }
    switch (target.resource) {
      case Resource::kScene:
        SendResult(response, *view, jobs_.Files(target.id).Scene(), "model/gltf-binary");
        return;
      case Resource::kStatistics:
        SendResult(response, *view, jobs_.Files(target.id).Statistics(), "application/json");
        return;
      case Resource::kCancel:
        Cancel(response, target.id);
        return;
      default:
        break;
    }
    if (request.method == "DELETE") {
      jobs_.Remove(target.id);
      response.status = 204;
      return;
    }
    Answer(response, 200, *view);
  }

  void Cancel(Response& response, const std::string& id) {
    const bool canceled = jobs_.Cancel(id);
    const std::optional<JobView> view = jobs_.Find(id);
    if (!view) {
      throw UnknownJob();
    }
    if (!canceled && view->job.status != Status::kCanceled) {
      throw ProblemError(AlreadyEnded("the job has " + std::string(ToString(view->job.status)) + " already"));
    }
    Answer(response, 200, *view);
  }

  Jobs& jobs_;
  Options options_;
  Httplib server_;
  int port_ = -1;
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> over_ = false;
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
