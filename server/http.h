/// The service over HTTP (DESIGN section 2). Each answer is made as: parse, validate, call.
#pragma once

#include <memory>
#include <set>
#include <string>
#include <string_view>

#include "server/http_limits.h"
#include "server/jobs.h"
#include "server/tokens.h"

namespace radbake::server {

/// True for what a browser sends as Origin: scheme://host[:port] in lower case, without a path.
bool IsOrigin(std::string_view text);

class HttpServer {
 public:
  struct Options {
    std::string host = "127.0.0.1";
    int port = 8080;  ///< 0: any free one
    HttpLimits limits;
    std::shared_ptr<const Tokens> tokens;  ///< null: everybody is the same client
    std::set<std::string> origins;         ///< of other pages that may use the service from a browser
  };

  /// Binds the port: from here on connections are taken, and wait for Listen(). The jobs must outlive this
  /// object. Throws std::runtime_error if the address cannot be had.
  HttpServer(Jobs& jobs, const Options& options);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// http://host:port
  std::string Url() const;
  int port() const;

  /// Answers requests until Stop(). True if that was the reason.
  bool Listen();
  /// From any thread, once: takes no more connections, refuses the uploads that are under way (503), ends the
  /// streams of events, and lets the other requests end; those that wait for their clients have five seconds.
  void Stop();

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace radbake::server
