#include "server/memory.h"

#include <gtest/gtest.h>

#include "tests/server/service_test.h"

namespace radbake::server {
namespace {

class MemoryTest : public testing::Test {
 protected:
  void Write(const std::string& file, const std::string& text) const {
    std::filesystem::create_directories((root() / file).parent_path());
    WriteFile(root() / file, text);
  }
  const std::filesystem::path& root() const { return folder_.path(); }

 private:
  TemporaryFolder folder_;
};

TEST_F(MemoryTest, IsTheMachinesWhereThereAreNoGroups) {
  EXPECT_GT(MemoryBytes(root()), 1U << 20U);
  Write("proc/self/cgroup", "0::/a\n");
  Write("sys/fs/cgroup/a/memory.max", "max\n");
  EXPECT_GT(MemoryBytes(root()), 1U << 20U);
}

TEST_F(MemoryTest, IsTheLeastThatAGroupLeaves) {
  Write("proc/self/cgroup", "1:name=systemd:/b\n0::/a/b\n");
  Write("sys/fs/cgroup/a/b/memory.max", "300000\n");
  EXPECT_EQ(MemoryBytes(root()), 300000U);
  Write("sys/fs/cgroup/a/memory.max", "200000\n");
  EXPECT_EQ(MemoryBytes(root()), 200000U);
  Write("sys/fs/cgroup/memory.max", "100000\n");
  EXPECT_EQ(MemoryBytes(root()), 100000U) << "as in a container";
}

}  // namespace
}  // namespace radbake::server
