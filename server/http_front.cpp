#include "server/http_front.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>
#include <utility>

namespace radbake::server {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kHeadReadSize = 16384;
constexpr std::chrono::seconds kLinger{5};
constexpr std::chrono::seconds kLingerInACrowd{1};

// Reads what is there, and forgets it. True when the client has closed.
bool Forget(const ClientSocket& socket) {
  std::array<char, kHeadReadSize> forgotten{};
  const ssize_t count = ::recv(socket.descriptor.get(), forgotten.data(), forgotten.size(), MSG_DONTWAIT);
  return count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR);
}

}  // namespace

Front::Front(const HttpLimits& limits, std::function<void(Incoming)> ready)
    : limits_(limits), ready_(std::move(ready)), wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (!wake_.open()) {
    throw std::system_error(errno, std::generic_category(), "eventfd");
  }
  thread_ = std::thread([this] { Loop(); });
}

Front::~Front() {
  Stop();
}

std::size_t Front::connections() const {
  return *count_;
}

void Front::Wake() {
  const std::uint64_t one = 1;
  static_cast<void>(!::write(wake_.get(), &one, sizeof one));
}

void Front::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  Wake();
  if (thread_.joinable()) {
    thread_.join();
  }
}

// Most heads are there as soon as their connection is: those never see the loop.
void Front::Take(int socket) {
  Incoming incoming;
  incoming.socket.descriptor = Descriptor(socket);
  const bool full = ++*count_ > limits_.connections;
  incoming.socket.place = std::shared_ptr<void>(nullptr, [count = count_](void*) { --*count; });
  if (full) {
    incoming.refused = HttpProblem(503, "there are more than the " + std::to_string(limits_.connections) +
                                            " connections that are taken");
    ready_(std::move(incoming));
    return;
  }
  if (Advance(incoming)) {
    return;
  }
  Add({std::move(incoming), Clock::now() + limits_.head_time});
}

void Front::Linger(ClientSocket socket) {
  ::shutdown(socket.descriptor.get(), SHUT_WR);
  const auto time = *count_ > limits_.connections ? kLingerInACrowd : kLinger;
  Add({{std::move(socket), "", std::nullopt}, Clock::now() + time, true});
}

void Front::Add(Waiting waiting) {
  {
    const std::lock_guard lock(mutex_);
    if (stopping_) {
      return;
    }
    new_.push_back(std::move(waiting));
  }
  Wake();
}

// Reads what is there. True when the connection is done with here.
bool Front::Advance(Incoming& incoming) {
  std::array<char, kHeadReadSize> buffer{};
  const ssize_t count = ::recv(incoming.socket.descriptor.get(), buffer.data(), buffer.size(), MSG_DONTWAIT);
  if (count <= 0) {
    return count == 0 || (errno != EAGAIN && errno != EINTR);
  }
  incoming.bytes.append(buffer.data(), static_cast<std::size_t>(count));
  try {
    const std::optional<std::size_t> end = HeadEnd(incoming.bytes, limits_);
    if (!end) {
      return false;
    }
    incoming.bytes =
        Identified(Harmless(std::string_view(incoming.bytes).substr(0, *end))) + incoming.bytes.substr(*end);
  } catch (const ProblemError& error) {
    incoming.refused = error.problem();
  }
  ready_(std::move(incoming));
  return true;
}

void Front::Loop() {
  std::vector<Waiting> waiting;
  std::vector<pollfd> events;
  while (true) {
    {
      const std::lock_guard lock(mutex_);
      if (stopping_) {
        new_.clear();
        return;
      }
      std::move(new_.begin(), new_.end(), std::back_inserter(waiting));
      new_.clear();
    }
    events.assign(1, {wake_.get(), POLLIN, 0});
    Clock::time_point next = Clock::time_point::max();
    for (const Waiting& one : waiting) {
      events.push_back({one.incoming.socket.descriptor.get(), POLLIN, 0});
      next = std::min(next, one.deadline);
    }
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(next - Clock::now()).count();
    const int timeout = waiting.empty() ? -1 : static_cast<int>(std::clamp<std::int64_t>(left, 0, 60000));
    if (::poll(events.data(), events.size(), timeout) < 0) {
      continue;  // EINTR
    }
    if (events[0].revents != 0) {
      std::uint64_t times = 0;
      static_cast<void>(!::read(wake_.get(), &times, sizeof times));
    }
    const Clock::time_point now = Clock::now();
    std::vector<Waiting> left_over;
    for (std::size_t i = 0; i < waiting.size(); ++i) {
      Waiting& one = waiting[i];
      const bool late = now >= one.deadline;
      if (one.answered ? late || (events[i + 1].revents != 0 && Forget(one.incoming.socket))
                       : events[i + 1].revents != 0 && Advance(one.incoming)) {
        continue;
      }
      if (late) {
        one.incoming.refused = HttpProblem(408, "the head of the request has not come within " +
                                                    std::to_string(limits_.head_time.count()) + " seconds");
        ready_(std::move(one.incoming));
        continue;
      }
      left_over.push_back(std::move(one));
    }
    waiting = std::move(left_over);
  }
}

}  // namespace radbake::server
