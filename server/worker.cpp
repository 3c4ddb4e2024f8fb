#include "server/worker.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <system_error>
#include <utility>

#include "server/log.h"
#include "server/worker_end.h"

namespace radbake::server {
namespace {

constexpr std::chrono::milliseconds kSwarm{20};

Problem WorkerLost() {
  return BakeFailed("gave up after " + std::to_string(Queue::kAttempts) +
                    " attempts: the last one's worker was lost");
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

Workers::Workers(Queue& queue, Metrics& metrics, Options options, std::filesystem::path folder,
                 std::string name)
    : queue_(queue),
      metrics_(metrics),
      options_(std::move(options)),
      folder_(std::move(folder)),
      name_(std::move(name)),
      alive_(options_.count) {
  std::filesystem::remove_all(folder_);
  std::filesystem::create_directory(folder_);
  queue_.OnChange([this] { Wake(); });
  keeper_ = std::thread([this] { Keep(); });
  for (int i = 0; i < options_.count; ++i) {
    threads_.emplace_back([this] { Work(); });
  }
}

void Workers::Retire() {
  const std::lock_guard lock(mutex_);
  if (!stopping_) {
    stopping_ = true;
    graced_until_ = std::chrono::steady_clock::now() + options_.grace;
    changed_.notify_all();
  }
}

Workers::~Workers() {
  Retire();
  {
    std::unique_lock lock(mutex_);
    ended_.wait_until(lock, graced_until_, [&] { return running_.empty(); });
    for (const auto& running : running_) {
      running->stop.Raise();
    }
  }
  for (std::thread& thread : threads_) {
    thread.join();
  }
  keeper_.join();
  queue_.OnChange({});
}

void Workers::Wake() {
  {
    // Under the lock: a worker that has just found nothing must not miss it.
    const std::lock_guard lock(mutex_);
    ++news_;
  }
  changed_.notify_all();
}

void Workers::Stop(const std::string& id) {
  const std::lock_guard lock(mutex_);
  for (const auto& running : running_) {
    if (running->attempt.id == id) {
      running->lost = true;
      running->stop.Raise();
    }
  }
}

std::optional<Live> Workers::Find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto found = std::find_if(running_.rbegin(), running_.rend(),
                                  [&](const auto& running) { return running->attempt.id == id; });
  return found == running_.rend() ? std::nullopt : std::optional((*found)->live);
}

// The children die with the thread that started them: this loop is that thread's whole life.
void Workers::Work() {
  Job job;
  while (const std::shared_ptr<Running> running = Claim(job)) {
    const LogScope scope({{"job", job.id}});
    Bake(job, *running);
    {
      const std::lock_guard lock(mutex_);
      std::erase(running_, running);
    }
    ended_.notify_all();
    changed_.notify_all();
  }
  --alive_;
}

std::shared_ptr<Workers::Running> Workers::Claim(Job& job) {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    const std::uint64_t seen = news_;
    std::optional<Job> claimed;
    if (recovered_) {
      ++claims_;
      ++claiming_;
      lock.unlock();
      try {
        claimed = HasRoom() ? queue_.Claim(name_) : std::nullopt;
      } catch (const std::exception& error) {
        trouble_.Meet(error.what());
      }
      lock.lock();
      --claiming_;
    }
    if (claimed) {
      job = std::move(*claimed);
      running_.push_back(std::make_shared<Running>(Attempt{job.id, job.attempt}));
      if (stopping_) {
        running_.back()->stop.Raise();  // who stops has not seen it
      }
      return running_.back();
    }
    changed_.wait(lock, [&] { return stopping_ || news_ != seen; });
  }
  return nullptr;
}

bool Workers::HasRoom() const {
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(folder_, error);
  return !error && space.available >= options_.least_free;
}

void Workers::Bake(const Job& job, Running& running) {
  spdlog::info("the bake starts");
  if (job.attempt == 1) {
    metrics_.CountStart(job.started.value_or(job.created) - job.created);
  }
  const std::filesystem::path folder = folder_ / (job.id + "-" + std::to_string(job.attempt));
  try {
    // Whoever canceled it before it was known here could stop nothing.
    const std::optional<Job> now = queue_.Find(job.id);
    if (now && now->status == Status::kRunning && now->attempt == job.attempt) {
      queue_.Fetch(job.id, folder);
      const auto begin = std::chrono::steady_clock::now();
      const ChildEnd end = RunBake(job, running, folder);
      Count(end, running.stop.raised(), std::chrono::steady_clock::now() - begin, folder);
      Settle(job, running, end, folder);
    }
  } catch (const std::exception& error) {
    spdlog::error("{}", error.what());
    const auto* const missing = dynamic_cast<const std::filesystem::filesystem_error*>(&error);
    const bool gone = missing != nullptr && missing->code() == std::errc::no_such_file_or_directory;
    Persist(running, [&] {
      if (gone) {
        queue_.Crash(running.attempt, BakeFailed("the files of the upload are lost"));
      } else {
        queue_.Release(running.attempt);
      }
    });
    // No fault of the job's: what is missing here may be there again, or elsewhere.
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, options_.beat, [&] { return stopping_; });
  }
  std::error_code ignored;  // the next start removes what is left
  std::filesystem::remove_all(folder, ignored);
}

void Workers::Settle(const Job& job, Running& running, const ChildEnd& end,
                     const std::filesystem::path& folder) {
  const std::filesystem::path results = folder / "attempt";
  Live live = Find(job.id).value_or(Live());
  spdlog::info("the bake {}", HowItEnded(end));
  const bool room = HasRoom();
  const auto fail = [&](Problem problem) {
    problem.log = end.log;
    queue_.Finish(running.attempt, {Status::kFailed, live, std::move(problem)}, results);
  };
  Persist(running, [&] {
    if (end.exit_code == kBaked && IsResult(results / kBakedFile) && IsResult(results / kStatisticsFile)) {
      live.progress = 1;
      queue_.Finish(running.attempt, {Status::kSucceeded, live, std::nullopt}, results);
    } else if (end.exit_code == kBadInput) {
      fail(BadScene(Reason(end)));
    } else if (const std::string limit = LimitHit(end, options_.limits); !limit.empty()) {
      fail(BeyondLimit(limit));
    } else if (running.stop.raised() || !room) {
      queue_.Release(running.attempt);
    } else {
      const std::string how = end.exit_code == kBaked ? "left no result" : HowItEnded(end);
      Problem problem =
          BakeFailed("gave up after " + std::to_string(Queue::kAttempts) + " attempts: the last " + how);
      problem.log = end.log;
      queue_.Crash(running.attempt, problem);
    }
  });
}

void Workers::Count(const ChildEnd& end, bool stopped, std::chrono::duration<double> seconds,
                    const std::filesystem::path& folder) {
  const bool baked = end.exit_code == kBaked;
  const char* const outcome = baked                        ? "baked"
                              : end.exit_code == kBadInput ? "refused"
                              : stopped                    ? "stopped"
                                                           : "failed";
  metrics_.CountBake(outcome, seconds,
                     baked && IsResult(folder / "attempt" / kStatisticsFile)
                         ? Rays(folder / "attempt" / kStatisticsFile)
                         : 0);
  if (const std::optional<KillReason> reason = Killed(end, stopped)) {
    metrics_.CountKill(*reason);
  }
}

ChildEnd Workers::RunBake(const Job& job, Running& running, const std::filesystem::path& folder) {
  std::filesystem::create_directory(folder / "attempt");
  ChildCommand command = {
      options_.radbake,
      {"bake", job.scene, "-o", "attempt/baked.glb", "--parameters", "parameters.json", "--statistics",
       "attempt/statistics.json", "--progress", "json", "--threads", std::to_string(options_.threads)},
      folder,
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

// What is true must be written down, even if the disk is full or the database is away for a while. If the
// server ends before it could be, the job is taken back, and runs again.
void Workers::Persist(const Running& running, const std::function<void()>& change) {
  while (true) {
    try {
      const auto lost = [&] {
        const std::lock_guard lock(mutex_);
        return running.lost;
      };
      if (!lost()) {
        change();
      }
      return;
    } catch (const std::exception& error) {
      trouble_.Meet(error.what());
      std::unique_lock lock(mutex_);
      if (changed_.wait_for(lock, options_.beat, [&] { return stopping_; })) {
        return;
      }
    }
  }
}

void Workers::Drop(Running& running) {
  const std::lock_guard lock(mutex_);
  running.lost = true;
  running.stop.Raise();
}

void Workers::Keep() {
  LeaseWatch watch(options_.lease);
  LeaseWatch::Clock::time_point beat = LeaseWatch::Clock::now();
  std::unique_lock lock(mutex_);
  while (!stopping_ || !running_.empty()) {
    const std::uint64_t seen = news_;
    const bool due = LeaseWatch::Clock::now() >= beat;
    lock.unlock();
    try {
      Look(watch, due);
      trouble_.Miss();
    } catch (const std::exception& error) {
      trouble_.Meet(error.what());
    }
    if (due) {
      beat = LeaseWatch::Clock::now() + options_.beat;
      Wake();
    }
    lock.lock();
    // Hints come in swarms; all of one are looked after at once.
    const auto over = [&] { return stopping_ && running_.empty(); };
    changed_.wait_for(lock, std::min(kSwarm, options_.beat), over);
    changed_.wait_until(lock, beat, [&] { return over() || news_ != seen + (due ? 1U : 0U); });
  }
}

// What a claim has taken whose answer never came, for the database hung: nobody runs it. `claims`: how many
// had begun, and ended, before `held` was seen.
void Workers::ReleaseStrays(const std::vector<Held>& held, std::uint64_t claims) {
  std::vector<Attempt> strays;
  {
    const std::lock_guard lock(mutex_);
    if (claims_ != claims) {
      return;  // some of what is held may just have been claimed: the next look will tell
    }
    for (const Held& one : held) {
      const bool here = std::any_of(running_.begin(), running_.end(), [&](const auto& running) {
        return running->attempt.id == one.attempt.id && running->attempt.number == one.attempt.number;
      });
      if (one.worker == name_ && !here) {
        strays.push_back(one.attempt);
      }
    }
  }
  for (const Attempt& stray : strays) {
    if (queue_.Release(stray)) {
      spdlog::warn("job {}: attempt {} was claimed without an answer, and goes back", stray.id, stray.number);
    }
  }
}

void Workers::Look(LeaseWatch& watch, bool beat) {
  std::vector<std::shared_ptr<Running>> running;
  std::vector<Live> live;
  bool recovered = false;
  std::optional<std::uint64_t> claims;  // as long as none is under way
  {
    const std::lock_guard lock(mutex_);
    running = running_;
    claims = claiming_ == 0 ? std::optional(claims_) : std::nullopt;
    for (const auto& one : running) {
      live.push_back(one->live);
    }
    recovered = recovered_;
  }
  if (!recovered) {
    if (const std::size_t count = queue_.TakeBackFrom(name_, WorkerLost()); count > 0) {
      spdlog::info("{} jobs that were running when the last server here ended are taken back", count);
    }
    const std::lock_guard lock(mutex_);
    recovered_ = true;
  }
  for (std::size_t i = 0; beat && i < running.size(); ++i) {
    queue_.Beat(running[i]->attempt, live[i]);
  }
  // Whatever is seen as held now was claimed before: what began to run before and is not among it has been
  // lost.
  const std::vector<Held> held = queue_.ListHeld();
  for (const auto& one : running) {
    const bool holds = std::any_of(held.begin(), held.end(), [&](const Held& other) {
      return other.attempt.id == one->attempt.id && other.attempt.number == one->attempt.number;
    });
    if (!holds) {
      Drop(*one);
    }
  }
  if (claims) {
    ReleaseStrays(held, *claims);
  }
  for (const Held& lapsed : watch.Lapsed(held, LeaseWatch::Clock::now())) {
    if (queue_.TakeBack(lapsed, WorkerLost())) {
      spdlog::warn("job {}: its worker has given no sign of life, attempt {} is taken back",
                   lapsed.attempt.id, lapsed.attempt.number);
    }
  }
}

}  // namespace radbake::server
