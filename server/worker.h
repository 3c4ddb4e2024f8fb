/// The workers: each takes the oldest queued job, bakes it in a child process, and writes down how it ended.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "server/child.h"
#include "server/metrics.h"
#include "server/queue.h"

namespace radbake::server {

/// A child that ended without an answer (killed, crashed, exit code 1) is tried again, so often in all.
inline constexpr int kAttempts = 3;

/// The files of one job, in its folder.
struct JobFiles {
  std::filesystem::path folder;

  std::filesystem::path Parameters() const { return folder / "parameters.json"; }
  std::filesystem::path Upload() const { return folder / "upload"; }    ///< the scene and its resources
  std::filesystem::path Attempt() const { return folder / "attempt"; }  ///< what the running child writes
  std::filesystem::path Scene() const {
    return folder / "baked.glb";
  }  ///< the result, whole once it is there
  std::filesystem::path Statistics() const { return folder / "statistics.json"; }
};

/// So many of the last iterations are shown of a job.
inline constexpr std::size_t kIterationsShown = 8;

/// Takes over a line of `radbake bake --progress json`. A line that is none changes nothing; progress never
/// falls. The statistics get "error", "seconds", "iteration" (the newest) and "iterations" (the last ones,
/// oldest first), as far as told.
void ReadProgress(std::string_view line, Live& live);

class Workers {
 public:
  struct Options {
    std::filesystem::path radbake;        ///< absolute
    int count = 1;                        ///< children at a time
    int threads = 1;                      ///< of each
    ChildLimits limits;                   ///< of each
    std::vector<std::string> flags = {};  ///< that the program gets beside those of the job
    std::chrono::seconds grace{0};        ///< that running children get to end when the workers stop
  };

  /// Starts the threads. `files` gives the files of a job. The queue and the metrics must outlive this
  /// object.
  Workers(Queue& queue, Metrics& metrics, Options options,
          std::function<JobFiles(const std::string& id)> files);
  /// Takes no more jobs, gives the children their grace, and stops those that are left: their jobs go back to
  /// the queue.
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  /// There may be a new job.
  void Wake();
  /// Stops the job's child if it has one: whoever asks has changed the job in the queue before. True if it
  /// had one; its folder then belongs to the worker, which removes it when the job is no longer in the queue.
  bool Stop(const std::string& id);
  std::optional<Live> Find(const std::string& id) const;
  /// How many take jobs.
  int alive() const { return alive_; }

 private:
  struct Running {
    StopSignal stop;
    Live live;
  };

  void Work();
  std::shared_ptr<Running> Claim(Job& job);
  void Bake(const Job& job, Running& running);
  void Count(const Job& job, const ChildEnd& end, bool stopped, std::chrono::duration<double> seconds);
  ChildEnd RunBake(const Job& job, Running& running);
  void Persist(const std::function<void()>& change);
  bool stopping() const;

  Queue& queue_;
  Metrics& metrics_;
  Options options_;
  std::function<JobFiles(const std::string&)> files_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::condition_variable ended_;  ///< one of the running
  bool stopping_ = false;
  std::map<std::string, std::shared_ptr<Running>> running_;
  std::atomic<int> alive_;
  std::vector<std::thread> threads_;
};

}  // namespace radbake::server
