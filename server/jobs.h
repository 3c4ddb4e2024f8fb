/// The service without HTTP: a data folder with the queue, the files of its jobs, and the workers.
///
///     DIR/lock               held by the one radbaked that uses the folder
///     DIR/jobs.sqlite        the queue
///     DIR/jobs/<id>/         one folder a job (JobFiles); one without a row in the queue is removed at the
///     start
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "server/files.h"
#include "server/queue.h"
#include "server/worker.h"

namespace radbake::server {

/// A job as the service shows it: what the queue knows, and what its worker knows while it runs.
struct JobView {
  Job job;
  std::optional<Live> live;
};

/// The folder of a job that is not queued yet. Removed again unless Jobs::Submit() took it.
class Draft {
 public:
  explicit Draft(JobFiles files);
  Draft(Draft&& other) noexcept;
  ~Draft();
  const JobFiles& files() const { return files_; }

 private:
  friend class Jobs;
  JobFiles files_;
  bool taken_ = false;
};

/// Thread-safe.
class Jobs {
 public:
  /// Takes the data folder (and makes it if need be), queues again what was running when its last server
  /// ended, removes what belongs to no job, and starts the workers. Throws std::exception with what is wrong.
  Jobs(const std::filesystem::path& data, const Workers::Options& options);

  Draft Begin();
  /// Makes the draft's files durable, then queues the job. `scene` is relative to the job's folder. When this
  /// returns, the job will be done, whatever happens to this process.
  JobView Submit(Draft draft, const std::string& scene);
  std::optional<JobView> Find(const std::string& id);
  JobFiles Files(const std::string& id) const;
  /// False if the job has ended already or is not there.
  bool Cancel(const std::string& id);
  /// Stops and forgets the job, with its files. False if it is not there.
  bool Remove(const std::string& id);

 private:
  std::filesystem::path folder_;
  Descriptor lock_;
  std::optional<Queue> queue_;
  std::optional<Workers> workers_;
};

/// The job as JSON: the body of an answer.
nlohmann::json ToJson(const JobView& view);

}  // namespace radbake::server
