#include "server/http_watchers.h"

#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <iterator>
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
    : jobs_(jobs), limits_(limits), again_(std::move(again)), places_(limits.watchers), thread_([this] {
        Loop();
      }) {}

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

void Watchers::Watch(Place place, ClientSocket socket, const std::string& job, const std::string& last) {
  Add({std::move(place),
       {std::move(socket), "", std::nullopt},
       job,
       std::nullopt,
       last,
       "",
       Clock::now(),
       Clock::now()});
}

void Watchers::Hold(Place place, Incoming request, const std::string& job, Clock::time_point deadline) {
  Add({std::move(place), std::move(request), job, deadline, "", "", Clock::now(), Clock::now()});
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

// Null: how the job is cannot be known now.
const Watchers::Seen* Watchers::Look(const std::string& job,
                                     std::map<std::string, std::optional<Seen>>& seen) {
  const auto [found, is_new] = seen.try_emplace(job);
  if (is_new) {
    try {
      std::optional<Job> now = jobs_.Find(job);
      Event event = now ? ToEvent(*now) : Event();
      found->second = Seen{std::move(now), std::move(event)};
    } catch (const std::exception& error) {
      trouble_.Meet(std::string("jobs cannot be watched: ") + error.what());
    }
  }
  return found->second ? &*found->second : nullptr;
}

// False when the watcher is done with.
bool Watchers::Advance(Watcher& watcher, const Seen* seen) {
  const Clock::time_point now = Clock::now();
  const bool ended = seen != nullptr && (!seen->job || Ended(seen->job->status));
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
  if (seen != nullptr && seen->job && !watcher.over && seen->event.id != watcher.last) {
    watcher.last = seen->event.id;
    watcher.unsent += "event: job\nid: " + seen->event.id + "\ndata: " + seen->event.data + "\n\n";
    watcher.written = now;
  } else if (now - watcher.written >= limits_.comment) {
    watcher.unsent += ":\n\n";
    watcher.written = now;
  }
  watcher.over = watcher.over || ended;
  const std::size_t unsent = watcher.unsent.size();
  const bool there = Listens(watcher.incoming.socket) && Flush(watcher.incoming.socket, watcher.unsent);
  jobs_.metrics().CountSent(unsent - watcher.unsent.size());
  if (watcher.unsent.empty() || watcher.unsent.size() < unsent) {
    watcher.taken = now;
  }
  return there && watcher.unsent.size() <= kMostUnsent && now - watcher.taken <= limits_.idle_time &&
         !(watcher.over && watcher.unsent.empty());
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
    std::map<std::string, std::optional<Seen>> seen;
    std::vector<Watcher> left;
    for (Watcher& watcher : watchers) {
      if (Advance(watcher, Look(watcher.job, seen))) {
        left.push_back(std::move(watcher));
      }
    }
    if (std::none_of(seen.begin(), seen.end(), [](const auto& one) { return !one.second; })) {
      trouble_.Miss();
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
