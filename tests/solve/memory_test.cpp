/// What the solver's containers say that they hold, against what the process does.
#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>

#include "solver/solve/couplings.h"
#include "solver/solve/rows.h"
#include "solver/solve/solver.h"
#include "tests/test_scenes.h"

namespace radbake {
namespace {

#if !defined(RADBAKE_ADDRESS_SANITIZER) && !defined(RADBAKE_THREAD_SANITIZER)  // whose malloc tells nothing

std::size_t Allocated() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

SolveOptions Fine(BasisOrder basis) {
  SolveOptions options;
  options.basis = basis;
  options.w_min = 2e-4;
  return options;
}

/// Whether `counted` is within a tenth of what was allocated since `before`.
::testing::AssertionResult IsTrue(std::size_t counted, std::size_t before) {
  const std::size_t real = Allocated() - before;
  const double ratio = static_cast<double>(counted) / static_cast<double>(real);
  return (std::abs(ratio - 1) < 0.1 ? ::testing::AssertionSuccess() : ::testing::AssertionFailure())
         << counted << " counted, " << real << " allocated";
}

class SolveMemory : public ::testing::TestWithParam<BasisOrder> {};

TEST_P(SolveMemory, IsWhatIsAllocated) {
  const Patches patches = CutIntoPatches(testing::ShadowRoom());
  const Visibility visibility(patches);
  {
    Hierarchy warm_up(patches);  // what libraries allocate once
    Solve(warm_up, visibility, Fine(GetParam()));
  }
  const std::size_t before = Allocated();
  Hierarchy hierarchy(patches);
  const Solution solution = Solve(hierarchy, visibility, Fine(GetParam()));
  const std::size_t held = hierarchy.Bytes() + solution.light.Bytes() + solution.links.Bytes();
  EXPECT_TRUE(IsTrue(held, before));

  const std::size_t without_rows = Allocated();
  const Rows rows(hierarchy, solution.links, solution.light);
  EXPECT_TRUE(IsTrue(rows.Bytes(), without_rows));
  if (GetParam() != BasisOrder::kConstant) {
    const std::size_t without_couplings = Allocated();
    const Couplings couplings(hierarchy, visibility, solution.links, solution.light);
    EXPECT_TRUE(IsTrue(couplings.Bytes(), without_couplings));
  }
}

TEST_P(SolveMemory, OfElementsAndLinksHoldsAllThatAnIterationNeeds) {
  const Patches patches = CutIntoPatches(testing::ShadowRoom());
  const Visibility visibility(patches);
  const std::size_t before = Allocated();
  Hierarchy hierarchy(patches);
  SolveOptions options = Fine(GetParam());
  std::size_t iterating = 0;  // of the last pass, between applications of the operator
  options.stop = [&](const Iteration& iteration) {
    iterating = iteration.sweeps > 0 ? Allocated() - before : 0;
    return false;
  };
  const Solution solution = Solve(hierarchy, visibility, options);
  const std::size_t counted = solution.bytes.elements + solution.bytes.links;
  ASSERT_GT(iterating, 0U);
  EXPECT_GT(counted, iterating);
  // What is not there between two cycles: the vectors of one.
  EXPECT_LT(counted, 2 * iterating);
  EXPECT_GT(solution.bytes.elements, 500 * solution.iterations.back().elements);
  EXPECT_GT(solution.bytes.links, sizeof(Link) * solution.iterations.back().links);
}

INSTANTIATE_TEST_SUITE_P(Bases, SolveMemory,
                         ::testing::Values(BasisOrder::kConstant, BasisOrder::kLinear,
                                           BasisOrder::kQuadratic));

#endif

}  // namespace
}  // namespace radbake
