#include "server/http_watchers.h"

#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/digest.h"

namespace radbake::server {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kBetweenLooks{100};
constexpr std::size_t kMostUnsent = 256 << 10U;
constexpr std::size_t kIdSize = 16;

// True while the client is there: it has nothing more to say, and what it says is forgotten.
bool Listens(const ClientSocket& socket) {
  std::array<char, 1024> said{};
  const ssize_t count = ::recv(socket.descriptor.get(), said.data(), said.size(), MSG_DONTWAIT);
  return count > 0 || (count < 0 && (errno == EAGAIN || errno == EINTR));
}

// Sends what the client takes at once. False if it is gone.
bool Flush(const ClientSocket& socket, std::string& unsent) {
  while (!unsent.empty()) {
    const ssize_t count =
        ::send(socket.descriptor.get(), unsent.data(), unsent.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count < 0) {
      return errno == EAGAIN || errno == EINTR;
    }
    unsent.erase(0, static_cast<std::size_t>(count));
  }
  return true;
}

}  // namespace

Event ToEvent(const Job& job) {
  std::string data = ToText(ToJson(job));
  std::string id = Sha256Hex(data).substr(0, kIdSize);
  return {std::move(id), std::move(data)};
}

Watchers::Watchers(Jobs& jobs, const HttpLimits& limits, std::function<void(Incoming)> again)
    : jobs_(jobs), limits_(limits), again_(std::move(again)), thread_([this] { Loop(); }) {}

Watchers::~Watchers() {
  Stop();
}

void Watchers::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) {
    thread_.join();
  }
}

Watchers::Place Watchers::Reserve() {
  const bool full = ++*count_ > limits_.watchers;
  Place place(static_cast<void*>(count_.get()), [count = count_](void*) { --*count; });
  return full ? nullptr : place;
}

void Watchers::Watch(Place place, ClientSocket socket, const std::string& job, const std::string& last) {
  Add({std::move(place), {std::move(socket), "", std::nullopt}, job, std::nullopt, last, "", Clock::now()});
}

void Watchers::Hold(Place place, Incoming request, const std::string& job, Clock::time_point deadline) {
  Add({std::move(place), std::move(request), job, deadline, "", "", Clock::now()});
}

void Watchers::Add(Watcher watcher) {
  std::unique_lock lock(mutex_);
  if (!stopping_) {
    new_.push_back(std::move(watcher));
    changed_.notify_all();
  } else if (watcher.deadline) {
    lock.unlock();
    again_(std::move(watcher.incoming));
  }
}

// False when the watcher is done with.
bool Watchers::Advance(Watcher& watcher, const std::optional<Job>& job, const Event& event) {
  const Clock::time_point now = Clock::now();
  const bool ended = !job || Ended(job->status);
  if (watcher.deadline) {
    if (!Listens(watcher.incoming.socket)) {
      return false;
    }
    if (ended || now >= *watcher.deadline) {
      again_(std::move(watcher.incoming));
      return false;
    }
    return true;
  }
  if (job && !watcher.over && event.id != watcher.last) {
    watcher.last = event.id;
    watcher.unsent += "event: job\nid: " + event.id + "\ndata: " + event.data + "\n\n";
    watcher.written = now;
  } else if (now - watcher.written >= limits_.comment) {
    watcher.unsent += ":\n\n";
    watcher.written = now;
  }
  watcher.over = watcher.over || ended;
  const std::size_t unsent = watcher.unsent.size();
  const bool there = Listens(watcher.incoming.socket) && Flush(watcher.incoming.socket, watcher.unsent);
  jobs_.metrics().CountSent(unsent - watcher.unsent.size());
  return there && watcher.unsent.size() <= kMostUnsent && !(watcher.over && watcher.unsent.empty());
}

void Watchers::Loop() {
  std::vector<Watcher> watchers;
  while (true) {
    {
      std::unique_lock lock(mutex_);
      if (watchers.empty()) {
        changed_.wait(lock, [&] { return stopping_ || !new_.empty(); });
      } else {
        changed_.wait_for(lock, kBetweenLooks, [&] { return stopping_ || !new_.empty(); });
      }
      std::move(new_.begin(), new_.end(), std::back_inserter(watchers));
      new_.clear();
      if (stopping_) {
        break;
      }
    }
    std::map<std::string, std::pair<std::optional<Job>, Event>> seen;
    std::vector<Watcher> left;
    for (Watcher& watcher : watchers) {
      try {
        auto found = seen.find(watcher.job);
        if (found == seen.end()) {
          std::optional<Job> job = jobs_.Find(watcher.job);
          Event event = job ? ToEvent(*job) : Event();
          found = seen.emplace(watcher.job, std::pair(std::move(job), std::move(event))).first;
        }
        if (!Advance(watcher, found->second.first, found->second.second)) {
          continue;
        }
      } catch (const std::exception& error) {
        spdlog::error("job {} cannot be watched: {}", watcher.job, error.what());  // until it can be again
      }
      left.push_back(std::move(watcher));
    }
    watchers = std::move(left);
  }
  for (Watcher& watcher : watchers) {
    if (watcher.deadline) {
      again_(std::move(watcher.incoming));
    }
  }
}

}  // namespace radbake::server
