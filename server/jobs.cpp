#include "server/jobs.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>
#include <vector>

namespace radbake::server {
namespace {

using namespace std::chrono_literals;

// RFC 3339, UTC, milliseconds.
std::string ToString(Time time) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(time);
  const std::time_t whole = std::chrono::system_clock::to_time_t(seconds);
  std::tm parts{};
  gmtime_r(&whole, &parts);
  std::array<char, 64> text{};
  const std::size_t length = std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S", &parts);
  const std::string fraction = std::to_string(1000 + (time - seconds).count());
  return std::string(text.data(), length) + "." + fraction.substr(1) + "Z";
}

nlohmann::json ToJson(const std::optional<Time>& time) {
  return time ? nlohmann::json(ToString(*time)) : nlohmann::json(nullptr);
}

}  // namespace

Draft::Draft(JobFiles files) : files_(std::move(files)) {
  std::filesystem::create_directory(files_.folder);
  std::filesystem::create_directory(files_.Upload());
}

Draft::Draft(Draft&& other) noexcept
    : files_(std::move(other.files_)), taken_(std::exchange(other.taken_, true)) {}

Draft::~Draft() {
  if (!taken_) {
    std::error_code ignored;  // the next start removes what is left
    std::filesystem::remove_all(files_.folder, ignored);
  }
}

Jobs::Jobs(const std::filesystem::path& data, const Options& options)
    : folder_(data / "jobs"), keep_(options.keep), least_free_(options.least_free) {
  std::filesystem::create_directories(folder_);
  lock_ = LockFolder(data);
  queue_.emplace(data / "jobs.sqlite", options.keep);
  if (const std::size_t count = queue_->ReleaseAll(); count > 0) {
    spdlog::info("{} jobs that were running are queued again", count);
  }
  std::vector<std::filesystem::path> orphans;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    if (!queue_->Find(entry.path().filename().string())) {
      orphans.push_back(entry.path());
    }
  }
  for (const std::filesystem::path& orphan : orphans) {
    std::filesystem::remove_all(orphan);
  }
  SyncFolder(data);
  workers_.emplace(*queue_, metrics_, options.workers, [this](const std::string& id) { return Files(id); });
  forgetter_ = std::thread([this] { Forget(); });
}

Jobs::~Jobs() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stopped_.notify_all();
  forgetter_.join();
}

// Forgets a job a minute late at most, and much less late where jobs are kept for a short time.
void Jobs::Forget() {
  const auto pause = std::clamp<std::chrono::milliseconds>(keep_ / 10, 10ms, 1min);
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    lock.unlock();
    try {
      for (const std::string& id : queue_->Forget(Now())) {
        if (!workers_->Stop(id)) {
          std::filesystem::remove_all(Files(id).folder);
        }
        spdlog::info("job {}: forgotten", id);
      }
    } catch (const std::exception& error) {
      spdlog::error("jobs cannot be forgotten: {}", error.what());  // the next start removes what is left
    }
    lock.lock();
    stopped_.wait_for(lock, pause, [&] { return stopping_; });
  }
}

JobFiles Jobs::Files(const std::string& id) const {
  return {folder_ / id};
}

Draft Jobs::Begin() {
  return Draft(Files(RandomId()));
}

Added Jobs::Submit(Draft draft, Submission submission) {
  SyncTree(draft.files().folder);
  SyncFolder(folder_);
  const std::string id = draft.files().folder.filename().string();
  Added added =
      queue_->Add({id, std::move(submission.owner), std::move(submission.scene), std::move(submission.key)});
  if (added.kind == Added::Kind::kNew) {
    draft.taken_ = true;
    workers_->Wake();
  }
  return added;
}

std::optional<Job> Jobs::Find(const std::string& id) {
  // First what its worker tells: a job that ends meanwhile is then seen as ended.
  std::optional<Live> live = workers_->Find(id);
  std::optional<Job> job = queue_->Find(id);
  if (job && job->status == Status::kRunning && live) {
    job->live = std::move(*live);
  }
  return job;
}

std::vector<Job> Jobs::List(const Page& page) {
  std::vector<Job> jobs = queue_->List(page);
  for (Job& job : jobs) {
    if (std::optional<Live> live = workers_->Find(job.id); live && job.status == Status::kRunning) {
      job.live = std::move(*live);
    }
  }
  return jobs;
}

bool Jobs::Cancel(const std::string& id) {
  if (!queue_->Cancel(id, workers_->Find(id).value_or(Live()))) {
    return false;
  }
  workers_->Stop(id);
  return true;
}

bool Jobs::Remove(const std::string& id) {
  if (!queue_->Remove(id)) {
    return false;
  }
  if (!workers_->Stop(id)) {
    std::error_code ignored;  // the next start removes what is left
    std::filesystem::remove_all(Files(id).folder, ignored);
  }
  return true;
}

std::string Jobs::Trouble() {
  try {
    queue_->Count();
  } catch (const QueueError&) {
    return "the database cannot be read";
  }
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(folder_, error);
  if (error) {
    return "the data folder is gone";
  }
  if (space.available < least_free_) {
    return "the disk has less than the " + std::to_string(least_free_) + " bytes left that it should have";
  }
  return workers_->alive() == 0 ? "no worker takes jobs" : "";
}

std::uint64_t Jobs::FreeBytes() const {
  return std::filesystem::space(folder_).available;
}

nlohmann::json ToJson(const Job& job) {
  const std::string self = "/v1/bakes/" + job.id;
  nlohmann::json json = {
      {"id", job.id},
      {"status", ToString(job.status)},
      {"attempt", job.attempt},
      {"progress", job.live.progress},
      {"phase", job.live.phase.empty() ? nlohmann::json() : nlohmann::json(job.live.phase)},
      {"statistics", job.live.statistics},
      {"created_at", ToString(job.created)},
      {"started_at", ToJson(job.started)},
      {"ended_at", ToJson(job.ended)},
      {"expires_at", ToJson(job.expires)},
      {"links",
       {{"self", self},
        {"scene", self + "/scene"},
        {"statistics", self + "/statistics"},
        {"events", self + "/events"},
        {"cancel", self + "/cancel"}}}};
  if (job.problem) {
    json["error"] = ToJson(*job.problem);
  }
  return json;
}

}  // namespace radbake::server
