/// What the tests of the queue share: each is run with both databases.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "server/queue.h"
#include "tests/server/service_test.h"

namespace radbake::server {

inline const std::string kWorker = "worker";

/// A statement in a file of SQLite's.
void RunInSqlite(const std::filesystem::path& file, const std::string& sql);

std::string ReadAll(StoredFile& file, std::size_t most);

class QueueTest : public testing::TestWithParam<const char*> {
 protected:
  static bool Postgres() { return GetParam() == std::string("Postgres"); }
  const std::filesystem::path& data() const { return folder_.path(); }

  /// The queue of this test, once more.
  std::unique_ptr<Queue> Open(std::chrono::milliseconds keep = std::chrono::hours(24));
  /// A statement of its own, past the queue.
  void Run(const std::string& sql) const;
  /// The folder of a new job with its upload.
  std::filesystem::path Draft(const std::string& id, const std::string& scene = "scene") const;
  Added Add(Queue& queue, const std::string& id, const std::string& owner = "",
            const std::optional<IdempotencyKey>& key = std::nullopt) const {
    return queue.Add({id, owner, "upload/scene.gltf", key}, Draft(id));
  }
  /// What a bake has written.
  std::filesystem::path Results(const std::string& scene) const;
  bool Succeed(Queue& queue, const std::string& id, int attempt, const std::string& scene = "baked") const {
    return queue.Finish({id, attempt}, {Status::kSucceeded, {}, std::nullopt}, Results(scene));
  }

 private:
  TemporaryFolder folder_;
  std::string url_;
};

}  // namespace radbake::server
