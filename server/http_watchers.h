/// Clients that wait for a job, in one thread for all of them: those that watch its events, and those whose
/// answer is held until it ends.
///
/// A watched job is looked at ten times a second. Each change is an event of type "job" whose data is the job
/// as GET shows it and whose id is a digest of that, so that a client that comes again with the id that it
/// saw last (on this server or on another) gets what is new and nothing twice. The stream ends after the
/// event of the job's end, or when the job is deleted.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/http_connection.h"
#include "server/jobs.h"
#include "server/places.h"
#include "server/trouble_log.h"

namespace radbake::server {

/// The event of a job as it is, without its end.
struct Event {
  std::string id;
  std::string data;
};
Event ToEvent(const Job& job);

class Watchers {
 public:
  /// `again` gets a held request when its time has come. The jobs must outlive this object.
  Watchers(Jobs& jobs, const HttpLimits& limits, std::function<void(Incoming)> again);
  ~Watchers();
  Watchers(const Watchers&) = delete;
  Watchers& operator=(const Watchers&) = delete;

  /// Ends all streams, and hands over the held requests, also those to come.
  void Stop();

  /// A place, to be held until Watch() or Hold(); null if all are taken.
  Place Reserve() { return places_.Take(); }

  /// A stream of events, whose head has been written, to who has seen the event `last` (empty: none).
  void Watch(Place place, ClientSocket socket, const std::string& job, const std::string& last);
  /// A request that is handed over when the job has ended, is deleted, or the deadline is there.
  void Hold(Place place, Incoming request, const std::string& job,
            std::chrono::steady_clock::time_point deadline);

 private:
  struct Watcher {
    Place place;
    Incoming incoming;  ///< of a watcher: its socket alone
    std::string job;
    std::optional<std::chrono::steady_clock::time_point> deadline;  ///< of a held request
    std::string last;
    std::string unsent;
    std::chrono::steady_clock::time_point written;
    std::chrono::steady_clock::time_point taken;  ///< when the client has taken something last, or all
    bool over = false;
  };

  void Add(Watcher watcher);
  void Loop();
  /// A job as it was found; nothing: it is no more.
  struct Seen {
    std::optional<Job> job;
    Event event;
  };
  const Seen* Look(const std::string& job, std::map<std::string, std::optional<Seen>>& seen);
  bool Advance(Watcher& watcher, const Seen* seen);

  Jobs& jobs_;
  HttpLimits limits_;
  std::function<void(Incoming)> again_;
  Places places_;
  TroubleLog trouble_{"the jobs can be watched again"};
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stopping_ = false;
  std::vector<Watcher> new_;
  std::thread thread_;
};

}  // namespace radbake::server
