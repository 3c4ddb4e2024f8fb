#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/queue_lease.h"

namespace radbake::server {
namespace {

using namespace std::chrono_literals;
using testing::IsEmpty;
using testing::SizeIs;

// Looks once a second of a clock of the test's own, at leases of ten.
class LeaseTest : public testing::Test {
 protected:
  std::vector<Held> Look(const std::vector<Held>& held, std::chrono::milliseconds later = 1s) {
    now_ += later;
    return watch_.Lapsed(held, now_);
  }
  static Held Beaten(std::int64_t beats, int attempt = 1) { return {{"job", attempt}, beats}; }

 private:
  LeaseWatch watch_{10s};
  LeaseWatch::Clock::time_point now_{100h};
};

TEST_F(LeaseTest, LapsesWhenThereWasNoSignOfLifeForSoLong) {
  EXPECT_THAT(Look({Beaten(7)}), IsEmpty()) << "what is seen first may have beaten just now";
  for (int second = 1; second < 10; ++second) {
    EXPECT_THAT(Look({Beaten(7)}), IsEmpty()) << second;
  }
  EXPECT_THAT(Look({Beaten(7)}), SizeIs(1));
}

TEST_F(LeaseTest, LastsAsLongAsThereAreSignsOfLife) {
  for (int second = 0; second < 100; ++second) {
    EXPECT_THAT(Look({Beaten(second / 9)}), IsEmpty()) << second;
  }
}

TEST_F(LeaseTest, BeginsAnewWithAnotherAttempt) {
  for (int second = 0; second < 9; ++second) {
    Look({Beaten(7)});
  }
  Look({Beaten(7, 2)});
  for (int second = 1; second < 10; ++second) {
    EXPECT_THAT(Look({Beaten(7, 2)}), IsEmpty()) << second;
  }
  EXPECT_THAT(Look({Beaten(7, 2)}), SizeIs(1));
}

TEST_F(LeaseTest, BeginsAnewWhenTheJobWasNotHeldInBetween) {
  for (int second = 0; second < 9; ++second) {
    Look({Beaten(7)});
  }
  Look({});
  EXPECT_THAT(Look({Beaten(7)}), IsEmpty());
  EXPECT_THAT(Look({Beaten(7)}, 2s), IsEmpty());
}

TEST_F(LeaseTest, DoesNotEndInATimeInWhichNobodyLooked) {
  Look({Beaten(7)});
  EXPECT_THAT(Look({Beaten(7)}, 1h), IsEmpty()) << "its holder may have been halted as we were";
  EXPECT_THAT(Look({Beaten(8)}), IsEmpty());
}

}  // namespace
}  // namespace radbake::server
