/// The workers: each takes the next queued job, bakes it in a child process, and writes down how it ended.
/// What they hold is kept with signs of life, and what others hold without one is taken back.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
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
#include "server/queue_lease.h"
#include "server/trouble_log.h"

namespace radbake::server {

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
    /// How long a job may be held without a sign of life.
    std::chrono::milliseconds lease = std::chrono::seconds(15);
    /// Between two signs of life, and between two looks for what others have changed.
    std::chrono::milliseconds beat = std::chrono::seconds(1);
    /// Bytes of the disk: while it has fewer left nothing is claimed, and a bake that fails is no fault of
    /// the job's.
    std::uint64_t least_free = 0;
  };

  /// Starts the threads. `name` names these workers in the queue: what workers of the same name held there is
  /// taken back before anything is claimed, for they are no more. Each running bake has a folder of its own
  /// in `folder`, which is theirs alone and is emptied. The queue and the metrics must outlive this object,
  /// and the queue's OnChange() is theirs.
  Workers(Queue& queue, Metrics& metrics, Options options, std::filesystem::path folder, std::string name);
  /// Retires, and stops the children that are left after their grace: their jobs go back to the queue.
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  /// Takes no more jobs: the children's grace begins.
  void Retire();
  /// Stops the job's child if it has one here: whoever asks has changed the job in the queue before.
  void Stop(const std::string& id);
  /// What the child of a job that runs here has told last.
  std::optional<Live> Find(const std::string& id) const;
  /// How many take jobs.
  int alive() const { return alive_; }

 private:
  struct Running {
    explicit Running(Attempt held) : attempt(std::move(held)) {}
    Attempt attempt;
    StopSignal stop;
    Live live;
    bool lost = false;  ///< the job is no longer held: nothing more is written of it
  };

  void Work();
  std::shared_ptr<Running> Claim(Job& job);
  void Bake(const Job& job, Running& running);
  void Settle(const Job& job, Running& running, const ChildEnd& end, const std::filesystem::path& folder);
  void Count(const ChildEnd& end, bool stopped, std::chrono::duration<double> seconds,
             const std::filesystem::path& folder);
  ChildEnd RunBake(const Job& job, Running& running, const std::filesystem::path& folder);
  void Persist(const Running& running, const std::function<void()>& change);

  void Keep();
  void Look(LeaseWatch& watch, bool beat);
  void ReleaseStrays(const std::vector<Held>& held, std::uint64_t claims);
  void Drop(Running& running);
  void Wake();
  bool HasRoom() const;

  Queue& queue_;
  Metrics& metrics_;
  Options options_;
  std::filesystem::path folder_;
  std::string name_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::condition_variable ended_;  ///< one of the running
  bool stopping_ = false;
  std::chrono::steady_clock::time_point graced_until_;
  bool recovered_ = false;    ///< what the predecessors held has been taken back
  std::uint64_t news_ = 0;    ///< counts the reasons to look into the queue
  std::uint64_t claims_ = 0;  ///< that have begun
  std::size_t claiming_ = 0;  ///< and not ended
  TroubleLog trouble_{"the queue is back"};
  std::vector<std::shared_ptr<Running>> running_;  ///< in the order in which they began
  std::atomic<int> alive_;
  std::vector<std::thread> threads_;
  std::thread keeper_;
};

}  // namespace radbake::server
