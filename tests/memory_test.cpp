#include "solver/memory.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstdlib>
#include <fstream>

namespace radbake {
namespace {

/// A folder that stands for /, with what the kernel says there.
class FreeMemoryTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string folder = (std::filesystem::temp_directory_path() / "radbake-memory-XXXXXX").string();
    ASSERT_NE(mkdtemp(folder.data()), nullptr);
    root_ = folder;
  }
  void TearDown() override { std::filesystem::remove_all(root_); }
  void Write(const std::string& file, const std::string& text) const {
    std::filesystem::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text;
  }
  const std::filesystem::path& root() const { return root_; }

 private:
  std::filesystem::path root_;
};

TEST_F(FreeMemoryTest, IsWhatTheMachineHasAvailable) {
  Write("proc/meminfo", "MemTotal:       16000 kB\nMemAvailable:    1000 kB\nCached:  3000 kB\n");
  EXPECT_EQ(FreeMemory(root()), 1'024'000U);
  Write("proc/self/cgroup", "0::/a\n");
  Write("sys/fs/cgroup/a/memory.max", "max\n");
  Write("sys/fs/cgroup/a/memory.current", "5000\n");
  EXPECT_EQ(FreeMemory(root()), 1'024'000U);
}

TEST_F(FreeMemoryTest, IsTheLeastThatAGroupHasLeft) {
  Write("proc/meminfo", "MemAvailable:    1000 kB\n");
  Write("proc/self/cgroup", "1:name=systemd:/b\n0::/a/b\n");
  Write("sys/fs/cgroup/a/b/memory.max", "300000\n");
  Write("sys/fs/cgroup/a/b/memory.current", "100000\n");
  EXPECT_EQ(FreeMemory(root()), 200'000U);
  Write("sys/fs/cgroup/a/memory.max", "400000\n");
  Write("sys/fs/cgroup/a/memory.current", "350000\n");
  EXPECT_EQ(FreeMemory(root()), 50'000U);
  Write("sys/fs/cgroup/memory.max", "1000\n");
  Write("sys/fs/cgroup/memory.current", "2000\n");
  EXPECT_EQ(FreeMemory(root()), 0U);
}

TEST_F(FreeMemoryTest, IsTheMachinesWhereTheKernelDoesNotSay) {
  EXPECT_GT(FreeMemory(root()), 1U << 20U);
}

#if !defined(RADBAKE_ADDRESS_SANITIZER) && \
    !defined(RADBAKE_THREAD_SANITIZER)  // which take all addresses there are
TEST_F(FreeMemoryTest, IsLessUnderAResourceLimit) {
  constexpr rlim_t kLimit = 1ULL << 40U;
  Write("proc/meminfo", "MemAvailable:   100000000000 kB\n");
  for (const auto resource : {RLIMIT_AS, RLIMIT_DATA}) {
    rlimit before{};
    ASSERT_EQ(getrlimit(resource, &before), 0);
    const rlimit lower{.rlim_cur = kLimit, .rlim_max = before.rlim_max};
    ASSERT_EQ(setrlimit(resource, &lower), 0);
    const std::size_t left = FreeMemory(root());
    ASSERT_EQ(setrlimit(resource, &before), 0);
    EXPECT_LT(left, kLimit);
    EXPECT_GT(left, kLimit / 2);
  }
}
#endif

TEST(MemoryBudget, EndsWhatWouldPassTheLimitAndKnowsTheMost) {
  const Patches patches;
  const std::size_t base = MemoryBudget(0, 1000, patches).base();
  EXPECT_GT(base, 1000U);
  MemoryBudget budget(base + 2'000'000, 1000, patches);
  budget.Check(500'000);
  budget.Check(1'000'000);
  budget.Check(0);
  const std::size_t most = budget.TakeMost();
  EXPECT_GE(most, base + 1'000'000);
  EXPECT_LE(most, base + 1'500'000);
  EXPECT_EQ(budget.TakeMost(), 0U);
  try {
    budget.Check(2'000'001);
    ADD_FAILURE() << "not ended";
  } catch (const BeyondMemory& beyond) {
    EXPECT_GT(beyond.bytes, base + 2'000'000);
  }
}

TEST(Memory, IsToldInWords) {
  EXPECT_EQ(BytesInWords(1'940'000'000), "1.9 GB");
  EXPECT_EQ(BytesInWords(23'000'000'000), "23 GB");
  EXPECT_EQ(BytesInWords(400'000'000), "400 MB");
  EXPECT_EQ(BytesInWords(1'250'000), "1.2 MB");
}

}  // namespace
}  // namespace radbake
