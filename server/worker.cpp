#include "server/worker.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <fstream>
#include <system_error>
#include <utility>

#include "server/log.h"

namespace radbake::server {
namespace {

constexpr int kBaked = 0;
constexpr int kFailed = 1;
constexpr int kBadInput = 2;
constexpr std::chrono::seconds kRetry{1};

// Without the name of the program that said it.
std::string Reason(const ChildEnd& end) {
  constexpr std::string_view kPrefix = "radbake: ";
  std::string_view text = end.error;
  if (text.starts_with(kPrefix)) {
    text.remove_prefix(kPrefix.size());
  }
  return std::string(text);
}

std::string HowItEnded(const ChildEnd& end) {
  const std::string how = end.signal != 0      ? "was killed by signal " + std::to_string(end.signal)
                          : end.exit_code >= 0 ? "ended with exit code " + std::to_string(end.exit_code)
                                               : "left no result";
  return end.error.empty() ? how : how + ": " + Reason(end);
}

// The limit that has ended the child, in a sentence; empty: none. Another attempt would end alike.
std::string LimitHit(const ChildEnd& end, const ChildLimits& limits) {
  if (end.late) {
    return "the bake took longer than the " + std::to_string(limits.time.count()) +
           " seconds that it may take";
  }
  if (end.signal == SIGXCPU) {
    return "the bake took more than the " + std::to_string(limits.cpu_time.count()) +
           " seconds of processor time that it may take";
  }
  if (end.signal == SIGXFSZ) {
    return "the bake wrote more than the " + std::to_string(limits.file_size) + " bytes that a file may have";
  }
  return "";
}

// Why the child did not end by itself; nothing: it did.
std::optional<KillReason> Killed(const ChildEnd& end, bool stopped) {
  if (end.late) {
    return KillReason::kTime;
  }
  if (end.signal == SIGXCPU) {
    return KillReason::kCpuTime;
  }
  if (end.signal == SIGXFSZ) {
    return KillReason::kFileSize;
  }
  if (stopped) {
    return KillReason::kStopped;
  }
  if (end.exit_code == kFailed && Reason(end) == "out of memory") {
    return KillReason::kMemory;
  }
  return end.signal == 0 ? std::nullopt : std::optional(KillReason::kSignal);
}

// What a finished bake says that it has traced; 0: nothing.
std::uint64_t Rays(const std::filesystem::path& statistics) {
  std::ifstream file(statistics, std::ios::binary);
  const nlohmann::json told = nlohmann::json::parse(file, nullptr, false);
  const nlohmann::json::json_pointer count("/rays/count");
  return told.is_object() && told.contains(count) && told.at(count).is_number_unsigned()
             ? told.at(count).get<std::uint64_t>()
             : 0;
}

void PublishResult(const JobFiles& files) {
  Publish(files.Attempt() / "statistics.json", files.Statistics());
  Publish(files.Attempt() / "baked.glb", files.Scene());
  std::filesystem::remove_all(files.Attempt());
  SyncFolder(files.folder);
}

}  // namespace

void ReadProgress(std::string_view line, Live& live) {
  const nlohmann::json told = nlohmann::json::parse(line, nullptr, false);
  if (!told.is_object()) {
    return;
  }
  if (const auto phase = told.find("phase"); phase != told.end() && phase->is_string()) {
    live.phase = phase->get<std::string>();
  }
  if (const auto progress = told.find("progress"); progress != told.end() && progress->is_number()) {
    live.progress = std::max(live.progress, std::clamp(progress->get<double>(), 0.0, 1.0));
  }
  for (const char* key : {"error", "seconds", "iteration"}) {
    if (const auto value = told.find(key); value != told.end()) {
      live.statistics[key] = *value;
    }
  }
  if (const auto iteration = told.find("iteration"); iteration != told.end() && iteration->is_object()) {
    nlohmann::json& shown = live.statistics["iterations"];
    if (shown.empty() || shown.back() != *iteration) {
      shown.push_back(*iteration);
    }
    if (shown.size() > kIterationsShown) {
      shown.erase(shown.begin());
    }
  }
}

Workers::Workers(Queue& queue, Metrics& metrics, Options options,
                 std::function<JobFiles(const std::string& id)> files)
    : queue_(queue),
      metrics_(metrics),
      options_(std::move(options)),
      files_(std::move(files)),
      alive_(options_.count) {
  for (int i = 0; i < options_.count; ++i) {
    threads_.emplace_back([this] { Work(); });
  }
}

Workers::~Workers() {
  {
    std::unique_lock lock(mutex_);
    stopping_ = true;
    changed_.notify_all();
    ended_.wait_for(lock, options_.grace, [&] { return running_.empty(); });
    for (const auto& [id, running] : running_) {
      running->stop.Raise();
    }
  }
  for (std::thread& thread : threads_) {
    thread.join();
  }
}

void Workers::Wake() {
  // Under the lock: a worker that has just found nothing must not miss it.
  const std::lock_guard lock(mutex_);
  changed_.notify_all();
}

bool Workers::Stop(const std::string& id) {
  const std::lock_guard lock(mutex_);
  const auto found = running_.find(id);
  if (found == running_.end()) {
    return false;
  }
  found->second->stop.Raise();
  return true;
}

std::optional<Live> Workers::Find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto found = running_.find(id);
  return found == running_.end() ? std::nullopt : std::optional(found->second->live);
}

bool Workers::stopping() const {
  const std::lock_guard lock(mutex_);
  return stopping_;
}

// The children die with the thread that started them: this loop is that thread's whole life.
void Workers::Work() {
  Job job;
  while (const std::shared_ptr<Running> running = Claim(job)) {
    const LogScope scope({{"job", job.id}});
    Bake(job, *running);
    {
      const std::lock_guard lock(mutex_);
      running_.erase(job.id);
    }
    ended_.notify_all();
    try {
      if (!queue_.Find(job.id)) {
        std::filesystem::remove_all(files_(job.id).folder);
      }
    } catch (const std::exception& error) {
      spdlog::error("{}", error.what());  // the next start removes what is left
    }
  }
  --alive_;
}

// Claims and registers under one lock, so that Stop() finds every job that the queue calls running.
std::shared_ptr<Workers::Running> Workers::Claim(Job& job) {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    try {
      if (std::optional<Job> claimed = queue_.Claim()) {
        job = std::move(*claimed);
        return running_[job.id] = std::make_shared<Running>();
      }
      changed_.wait(lock);
    } catch (const std::exception& error) {
      spdlog::error("no job can be taken: {}", error.what());
      changed_.wait_for(lock, kRetry);
    }
  }
  return nullptr;
}

void Workers::Bake(const Job& job, Running& running) {
  spdlog::info("the bake starts");
  if (job.attempt == 1) {
    metrics_.CountStart(Now() - job.created);
  }
  const auto begin = std::chrono::steady_clock::now();
  ChildEnd end;
  try {
    end = RunBake(job, running);
    if (end.exit_code == kBaked) {
      PublishResult(files_(job.id));
    }
  } catch (const std::exception& error) {
    spdlog::error("{}", error.what());
    end = {};  // the client need not learn the server's paths
  }
  Count(job, end, running.stop.raised(), std::chrono::steady_clock::now() - begin);
  Live live = Find(job.id).value_or(Live());
  Persist([&] {
    if (end.exit_code == kBaked) {
      live.progress = 1;
      queue_.Finish(job.id, job.attempt, Status::kSucceeded, live, std::nullopt);
    } else if (end.exit_code == kBadInput) {
      queue_.Finish(job.id, job.attempt, Status::kFailed, live, BadScene(Reason(end)));
    } else if (const std::string limit = LimitHit(end, options_.limits); !limit.empty()) {
      queue_.Finish(job.id, job.attempt, Status::kFailed, live, BeyondLimit(limit));
    } else if (running.stop.raised()) {
      queue_.Release(job.id, job.attempt, job.crashes);
    } else if (job.crashes + 1 < kAttempts) {
      queue_.Release(job.id, job.attempt, job.crashes + 1);
    } else {
      queue_.Finish(job.id, job.attempt, Status::kFailed, live,
                    BakeFailed("gave up after " + std::to_string(kAttempts) + " attempts: the last " +
                               HowItEnded(end)));
    }
  });
  spdlog::info("the bake {}", HowItEnded(end));
}

void Workers::Count(const Job& job, const ChildEnd& end, bool stopped,
                    std::chrono::duration<double> seconds) {
  const bool baked = end.exit_code == kBaked;
  const char* const outcome = baked                        ? "baked"
                              : end.exit_code == kBadInput ? "refused"
                              : stopped                    ? "stopped"
                                                           : "failed";
  metrics_.CountBake(outcome, seconds, baked ? Rays(files_(job.id).Statistics()) : 0);
  if (const std::optional<KillReason> reason = Killed(end, stopped)) {
    metrics_.CountKill(*reason);
  }
}

ChildEnd Workers::RunBake(const Job& job, Running& running) {
  const JobFiles files = files_(job.id);
  // What an earlier attempt left behind, whoever still writes to it.
  std::filesystem::remove_all(files.Attempt());
  std::filesystem::create_directory(files.Attempt());
  ChildCommand command = {
      options_.radbake,
      {"bake", job.scene, "-o", "attempt/baked.glb", "--parameters", "parameters.json", "--statistics",
       "attempt/statistics.json", "--progress", "json", "--threads", std::to_string(options_.threads)},
      files.folder,
      options_.limits};
  command.arguments.insert(command.arguments.end(), options_.flags.begin(), options_.flags.end());
  return RunChild(
      command,
      [&](std::string_view line) {
        const std::lock_guard lock(mutex_);
        ReadProgress(line, running.live);
      },
      running.stop);
}

// What is true must be written down, even if the disk is full for a while. If the server ends before it could
// be, the job is found running at the next start, and runs again.
void Workers::Persist(const std::function<void()>& change) {
  while (true) {
    try {
      change();
      return;
    } catch (const std::exception& error) {
      spdlog::error("will be tried again: {}", error.what());
      std::unique_lock lock(mutex_);
      if (stopping_) {
        return;
      }
      changed_.wait_for(lock, kRetry);
    }
  }
}

}  // namespace radbake::server
