#include "server/http_connection.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <utility>

#include "server/text.h"

namespace radbake::server {
namespace {

constexpr std::size_t kSocketReadSize = 65536;
constexpr std::size_t kLongestChunkLine = 32768;  // of those that httplib reads byte by byte: a chunk's size
constexpr const char* kPrefix = "Radbaked-";
constexpr std::array<std::string_view, 4> kRenamed = {"range", "content-type", "content-encoding",
                                                      "accept-encoding"};
constexpr std::array<std::string_view, 4> kForgeable = {"remote_addr", "remote_port", "local_addr",
                                                        "local_port"};

template <typename List>
bool Contains(const List& list, std::string_view name) {
  return std::find(list.begin(), list.end(), name) != list.end();
}

bool IsToken(std::string_view name) {
  constexpr std::string_view kMarks = "!#$%&'*+-.^_`|~";
  return !name.empty() && std::all_of(name.begin(), name.end(), [&](unsigned char c) {
    return std::isalnum(c) != 0 || kMarks.find(static_cast<char>(c)) != std::string_view::npos;
  });
}

bool HasControl(std::string_view text) {
  return std::any_of(text.begin(), text.end(), [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return (byte < 0x20 && byte != '\t') || byte == 0x7F;
  });
}

// Safe in a log, in a header, and in a shell.
bool IsRequestId(std::string_view text) {
  constexpr std::size_t kLongest = 128;
  return !text.empty() && text.size() <= kLongest &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) {
           return std::isalnum(c) != 0 || c == '-' || c == '_' || c == '.';
         });
}

std::string Known(const std::string& name) {
  return Contains(kRenamed, Lower(name)) ? OwnHeader(name) : name;
}

}  // namespace

std::optional<std::size_t> HeadEnd(std::string_view bytes, const HttpLimits& limits) {
  const std::size_t end = bytes.find("\r\n\r\n");
  if (std::min(end, bytes.size()) > limits.head) {
    throw ProblemError(HttpProblem(431, "the head of the request is larger than the " +
                                            std::to_string(limits.head) + " bytes that are taken"));
  }
  if (end == std::string_view::npos) {
    return std::nullopt;
  }
  const auto lines = static_cast<std::size_t>(
      std::count(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(end), '\n'));
  if (lines > limits.headers) {
    throw ProblemError(HttpProblem(
        431, "the request has more than the " + std::to_string(limits.headers) + " headers that are taken"));
  }
  return end + 4;
}

std::string Harmless(std::string_view head) {
  std::size_t end = head.find("\r\n") + 2;
  if (HasControl(head.substr(0, end - 2))) {
    throw ProblemError(HttpProblem(400, "the request's line has a control character"));
  }
  std::string harmless(head.substr(0, end));
  bool identified = false;
  for (head.remove_prefix(end); head != "\r\n"; head.remove_prefix(end)) {
    end = head.find("\r\n") + 2;
    const std::string_view line = head.substr(0, end - 2);
    const std::size_t colon = std::min(line.find(':'), line.size());
    const std::string name = Lower(line.substr(0, colon));
    if (colon == line.size() || !IsToken(name) || HasControl(line.substr(colon))) {
      throw ProblemError(HttpProblem(400, "the request has a line that is no header: " + Quoted(line)));
    }
    if (name.starts_with(Lower(kPrefix)) || Contains(kForgeable, name)) {
      continue;
    }
    if (name == Lower(kRequestId)) {
      const std::string_view id = line.substr(std::min(line.find_first_not_of(' ', colon + 1), line.size()));
      if (identified || !IsRequestId(id)) {
        continue;
      }
      identified = true;
    }
    harmless += Contains(kRenamed, name) ? kPrefix : "";
    harmless += head.substr(0, end);
  }
  return harmless + "\r\n";
}

std::string Identified(std::string head) {
  if (Lower(head).find("\r\n" + Lower(kRequestId) + ":") == std::string::npos) {
    head.insert(head.size() - 2, std::string(kRequestId) + ": " + RandomId() + "\r\n");
  }
  return head;
}

std::string OwnHeader(const std::string& name) {
  return kPrefix + name;
}

std::string Header(const httplib::Request& request, const std::string& name) {
  return request.get_header_value(Known(name));
}

std::size_t HeaderCount(const httplib::Request& request, const std::string& name) {
  return request.get_header_value_count(Known(name));
}

Connection::Connection(Incoming incoming, const HttpLimits& limits, Places& slow, const StopSignal& over)
    : socket_(std::move(incoming.socket)),
      limits_(limits),
      slow_(slow),
      over_(over),
      buffer_(std::move(incoming.bytes)),
      head_(buffer_.size()) {}

// One direction may stand still for the idle time, and after that may fall no further behind than that.
bool Connection::Wait(short events, Flow& flow) {
  const Clock::time_point now = Clock::now();
  flow.since = flow.since.value_or(now);
  const std::chrono::duration<double> due(
      static_cast<double>(flow.bytes) / static_cast<double>(std::max<std::uint64_t>(limits_.least_rate, 1)));
  flow.late = flow.late || now - *flow.since > due + limits_.idle_time;
  std::array<pollfd, 2> polled = {{{socket_.descriptor.get(), events, 0}, {over_.descriptor(), POLLIN, 0}}};
  const int patience = static_cast<int>(limits_.idle_time.count() * 1000);
  int ready = -1;
  while (!flow.late && (ready = ::poll(polled.data(), polled.size(), patience)) < 0 && errno == EINTR) {
  }
  flow.late = flow.late || ready == 0;
  return ready > 0 && polled[0].revents != 0;
}

ssize_t Connection::read(char* bytes, std::size_t size) {
  if (taken_ == buffer_.size()) {
    if (!Wait(POLLIN, in_)) {
      return -1;
    }
    buffer_.resize(kSocketReadSize);
    taken_ = 0;
    const ssize_t count = ::recv(socket_.descriptor.get(), buffer_.data(), buffer_.size(), MSG_DONTWAIT);
    buffer_.resize(count > 0 ? static_cast<std::size_t>(count) : 0);
    in_.bytes += buffer_.size();
    if (buffer_.empty()) {
      return count;
    }
  }
  const std::size_t count = std::min(size, buffer_.size() - taken_);
  std::copy_n(buffer_.data() + taken_, count, bytes);
  taken_ += count;
  line_ = count == 1 && *bytes != '\n' ? line_ + 1 : 0;
  return line_ > kLongestChunkLine ? -1 : static_cast<ssize_t>(count);
}

ssize_t Connection::write(const char* bytes, std::size_t size) {
  if (muted_) {
    return static_cast<ssize_t>(size);
  }
  while (true) {
    const ssize_t count = ::send(socket_.descriptor.get(), bytes, size, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count >= 0) {
      out_.bytes += static_cast<std::uint64_t>(count);
      return count;
    }
    if (errno != EINTR && (errno != EAGAIN || !MayBeSlow() || !Wait(POLLOUT, out_))) {
      return -1;
    }
  }
}

bool Connection::MayBeSlow() {
  if (slow_place_ == nullptr) {
    slow_place_ = slow_.Take();
  }
  return slow_place_ != nullptr;
}

void Connection::get_remote_ip_and_port(std::string& ip, int& port) const {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  std::array<char, INET6_ADDRSTRLEN> text{};
  port = 0;
  ip.clear();
  if (::getpeername(socket_.descriptor.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    return;
  }
  if (address.ss_family == AF_INET) {
    const auto* v4 = reinterpret_cast<const sockaddr_in*>(&address);
    ::inet_ntop(AF_INET, &v4->sin_addr, text.data(), text.size());
    port = ntohs(v4->sin_port);
  } else if (address.ss_family == AF_INET6) {
    const auto* v6 = reinterpret_cast<const sockaddr_in6*>(&address);
    ::inet_ntop(AF_INET6, &v6->sin6_addr, text.data(), text.size());
    port = ntohs(v6->sin6_port);
  }
  ip = text.data();
}

void Connection::get_local_ip_and_port(std::string& ip, int& port) const {
  ip.clear();
  port = 0;
}

}  // namespace radbake::server
