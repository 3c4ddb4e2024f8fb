#include "server/jobs.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>
#include <vector>

#include "server/queue_postgres.h"
#include "server/queue_sqlite.h"

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

// What the workers of this folder are called in the queue, the next time too.
std::string WorkerName(const std::filesystem::path& data) {
  const std::filesystem::path file = data / "worker";
  std::string name;
  std::ifstream(file) >> name;
  if (name.empty()) {
    name = RandomId();
    const std::filesystem::path temporary = data / "worker.new";
    std::filesystem::remove(temporary);
    NewFile written(temporary);
    written.Append(name + "\n");
    written.Publish(file);
  }
  return name;
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
    : folder_(data / (options.database.empty() ? "jobs" : "drafts")),
      keep_(options.keep),
      least_free_(options.least_free),
      role_(options.role) {
  std::filesystem::create_directories(folder_);
  if (role_ != Role::kWorker) {
    lock_ = LockFolder(data, "lock");
  }
  if (role_ != Role::kApi) {
    worker_lock_ = LockFolder(data, "worker.lock");
  }
  if (options.database.empty()) {
    queue_ = std::make_unique<SqliteQueue>(data, keep_);
  } else {
    queue_ = std::make_unique<PostgresQueue>(options.database, keep_, options.database_timeout);
  }
  if (role_ != Role::kWorker) {
    RemoveDrafts();
  }
  if (role_ != Role::kApi) {
    Workers::Options workers = options.workers;
    workers.least_free = least_free_;
    workers_.emplace(*queue_, metrics_, std::move(workers), data / "work", WorkerName(data));
  }
  SyncFolder(data);
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

void Jobs::RemoveDrafts() {
  std::vector<std::filesystem::path> orphans;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    if (!queue_->KeepsFolder(entry.path().filename().string())) {
      orphans.push_back(entry.path());
    }
  }
  for (const std::filesystem::path& orphan : orphans) {
    std::filesystem::remove_all(orphan);
  }
}

// Forgets a job a minute late at most, and much less late where jobs are kept for a short time.
void Jobs::Forget() {
  const auto pause = std::clamp<std::chrono::milliseconds>(keep_ / 10, 10ms, 1min);
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    lock.unlock();
    try {
      for (std::vector<std::string> ids; !(ids = queue_->Forget()).empty();) {
        for (const std::string& id : ids) {
          spdlog::info("job {}: forgotten", id);
        }
      }
      forgetting_.Miss();
    } catch (const std::exception& error) {
      forgetting_.Meet(std::string("jobs cannot be forgotten: ") + error.what());
    }
    lock.lock();
    stopped_.wait_for(lock, pause, [&] { return stopping_; });
  }
}

Draft Jobs::Begin() {
  return Draft({folder_ / RandomId()});
}

Added Jobs::Submit(Draft draft, Submission submission) {
  const std::filesystem::path& folder = draft.files().folder;
  const std::string id = folder.filename().string();
  Added added = queue_->Add(
      {id, std::move(submission.owner), std::move(submission.scene), std::move(submission.key)}, folder);
  draft.taken_ = added.kind == Added::Kind::kNew;
  return added;
}

std::optional<Live> Jobs::FindLive(const std::string& id) const {
  return workers_ ? workers_->Find(id) : std::nullopt;
}

std::optional<Job> Jobs::Find(const std::string& id) {
  // First what its worker tells: a job that ends meanwhile is then seen as ended.
  std::optional<Live> live = FindLive(id);
  std::optional<Job> job = queue_->Find(id);
  if (job && job->status == Status::kRunning && live) {
    job->live = std::move(*live);
  }
  return job;
}

std::vector<Job> Jobs::List(const Page& page) {
  std::vector<Job> jobs = queue_->List(page);
  for (Job& job : jobs) {
    if (std::optional<Live> live = FindLive(job.id); live && job.status == Status::kRunning) {
      job.live = std::move(*live);
    }
  }
  return jobs;
}

void Jobs::Retire() {
  if (workers_) {
    workers_->Retire();
  }
}

bool Jobs::Cancel(const std::string& id) {
  const bool canceled = queue_->Cancel(id, FindLive(id));
  if (canceled && workers_) {
    workers_->Stop(id);
  }
  return canceled;
}

bool Jobs::Remove(const std::string& id) {
  const bool removed = queue_->Remove(id);
  if (removed && workers_) {
    workers_->Stop(id);
  }
  return removed;
}

std::string Jobs::Trouble() {
  try {
    queue_->Count();
  } catch (const QueueError&) {
    return "the database cannot be read";
  }
  if (::access(folder_.c_str(), W_OK) != 0) {
    return "the data folder cannot be written to";
  }
  const std::optional<std::uint64_t> free = FreeBytes();
  if (!free) {
    return "the data folder is gone";
  }
  if (*free < least_free_) {
    return "the disk has less than the " + std::to_string(least_free_) + " bytes left that it should have";
  }
  return workers_ && workers_->alive() == 0 ? "no worker takes jobs" : "";
}

std::optional<std::uint64_t> Jobs::FreeBytes() const {
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(folder_, error);
  return error ? std::nullopt : std::optional<std::uint64_t>(space.available);
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
