#include "supple/core/executor.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <vector>

#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "support/allocations.h"

namespace {

using namespace supple;

class Executors : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Threads, Executors, testing::Values(1, 2, 3, 8));

TEST_P(Executors, CoverEveryIndexOnceInBlocksOfTheGivenSize) {
  const Executor executor(GetParam());
  EXPECT_EQ(executor.threads(), GetParam());
  for (const std::size_t n : {0U, 1U, 9U, 10U, 11U, 1000U}) {
    std::vector<std::atomic<int>> seen(n);
    std::atomic<bool> aligned{true};
    executor.for_blocks(n, 10, [&](std::size_t begin, std::size_t end) {
      if (begin % 10 != 0 || end > n || (end - begin != 10 && end != n)) aligned = false;
      for (std::size_t i = begin; i < end; ++i) ++seen[i];
    });
    EXPECT_TRUE(aligned);
    for (const auto& count : seen) EXPECT_EQ(count, 1);
  }
}

TEST_P(Executors, RethrowTheFirstFailureInBlockOrderAfterAllBlocksEnded) {
  const Executor executor(GetParam());
  std::atomic<int> blocks{0};
  try {
    executor.for_blocks(100, 1, [&](std::size_t begin, std::size_t) {
      ++blocks;
      if (begin % 30 == 17) throw std::runtime_error(std::to_string(begin));
    });
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "17");
  }
  EXPECT_EQ(blocks, 100);
}

TEST_P(Executors, EndSoonInAScopeThatIsInterrupted) {
  const Executor executor(GetParam());
  std::atomic<int> interrupt{0}, blocks{0}, nested{0};
  const InterruptScope scope(&interrupt);
  executor.for_blocks(100, 1, [&](std::size_t, std::size_t) { ++blocks; });
  EXPECT_EQ(blocks, 100);
  EXPECT_THROW(executor.for_blocks(100000, 1,
                                   [&](std::size_t, std::size_t) {
                                     if (++blocks == 110) interrupt = 2;
                                     heed_scope();  // also on the threads of the executor
                                     ++nested;
                                   }),
               Interrupted);
  EXPECT_GE(blocks, 110);
  EXPECT_LE(blocks, 110 + GetParam());
  EXPECT_LE(nested, 10 + GetParam());
  {
    const InterruptScope none(nullptr);
    executor.for_blocks(10, 1, [&](std::size_t, std::size_t) { heed_scope(); });
  }
  EXPECT_THROW(heed_scope(), Interrupted);
}

TEST_P(Executors, RunLibraryCodeInside) {
  bool ran = false;
  Executor(GetParam()).run([&] { ran = true; });
  EXPECT_TRUE(ran);
}

TEST(Executor, TakesAllThreadsForZeroAndRefusesNegativeCounts) {
  EXPECT_GE(Executor(0).threads(), 1);
  EXPECT_THROW(Executor(-1), ContractViolation);
  EXPECT_THROW(Executor(1).for_blocks(5, 0, [](std::size_t, std::size_t) {}), ContractViolation);
}

}  // namespace
