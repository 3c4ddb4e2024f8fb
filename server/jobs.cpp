#include "server/jobs.h"

#include <spdlog/spdlog.h>

#include <array>
#include <cstdio>
#include <ctime>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>
#include <vector>

namespace radbake::server {
namespace {

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

Jobs::Jobs(const std::filesystem::path& data, const Workers::Options& options) : folder_(data / "jobs") {
  std::filesystem::create_directories(folder_);
  lock_ = LockFolder(data);
  queue_.emplace(data / "jobs.sqlite");
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
  workers_.emplace(*queue_, options, [this](const std::string& id) { return Files(id); });
}

JobFiles Jobs::Files(const std::string& id) const {
  return {folder_ / id};
}

Draft Jobs::Begin() {
  return Draft(Files(RandomId()));
}

JobView Jobs::Submit(Draft draft, const std::string& scene) {
  SyncTree(draft.files().folder);
  SyncFolder(folder_);
  const std::string id = draft.files().folder.filename().string();
  JobView view{queue_->Add(id, scene), std::nullopt};
  draft.taken_ = true;
  workers_->Wake();
  return view;
}

std::optional<JobView> Jobs::Find(const std::string& id) {
  // First what its worker tells: a job that ends meanwhile is then seen as ended.
  std::optional<Live> live = workers_->Find(id);
  std::optional<Job> job = queue_->Find(id);
  if (!job) {
    return std::nullopt;
  }
  return JobView{std::move(*job), std::move(live)};
}

bool Jobs::Cancel(const std::string& id) {
  const double progress = workers_->Find(id).value_or(Live()).progress;
  if (!queue_->Cancel(id, progress)) {
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

nlohmann::json ToJson(const JobView& view) {
  const Job& job = view.job;
  const std::string self = "/v1/bakes/" + job.id;
  nlohmann::json json = {
      {"id", job.id},
      {"status", ToString(job.status)},
      {"progress", job.progress},
      {"phase", nullptr},
      {"created_at", ToString(job.created)},
      {"started_at", ToJson(job.started)},
      {"ended_at", ToJson(job.ended)},
      {"links", {{"self", self}, {"scene", self + "/scene"}, {"statistics", self + "/statistics"}}}};
  if (job.status == Status::kRunning && view.live) {
    json["progress"] = view.live->progress;
    json["phase"] = view.live->phase.empty() ? nlohmann::json(nullptr) : nlohmann::json(view.live->phase);
    json["statistics"] = view.live->statistics;
  }
  if (job.problem) {
    json["error"] = ToJson(*job.problem);
  }
  return json;
}

}  // namespace radbake::server
