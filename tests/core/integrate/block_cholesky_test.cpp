#include "integrate/block_cholesky.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <set>

#include "core/support.h"

namespace supple::core {
namespace {

using test::Draw;

struct System {
  Eigen::MatrixXd dense;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
};

/// Positive definite; about `neighbours` blocks a row.
System random_system(std::size_t blocks, std::size_t neighbours, Draw& draw) {
  System system;
  const auto size = static_cast<Eigen::Index>(6 * blocks);
  system.dense = Eigen::MatrixXd::Zero(size, size);
  std::set<std::pair<std::uint32_t, std::uint32_t>> taken;
  for (std::size_t k = 0; k < blocks * neighbours / 2; ++k) {
    const auto a = static_cast<std::uint32_t>(draw.uniform(0.0, 1.0) * static_cast<double>(blocks));
    const auto b = static_cast<std::uint32_t>(draw.uniform(0.0, 1.0) * static_cast<double>(blocks));
    if (a == b || !taken.insert(std::minmax(a, b)).second) continue;
    system.pairs.emplace_back(a, b);
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(6, size);
    for (Eigen::Index i = 0; i < 6; ++i) {
      for (Eigen::Index j = 0; j < 6; ++j) {
        rows(i, 6 * a + j) = draw.uniform(-1.0, 1.0);
        rows(i, 6 * b + j) = draw.uniform(-1.0, 1.0);
      }
    }
    system.dense += rows.transpose() * rows;
  }
  system.dense.diagonal().array() += 0.1;
  return system;
}

void load(const System& system, BlockCholesky& factor) {
  const auto blocks = static_cast<std::size_t>(system.dense.cols() / 6);
  factor.analyse(blocks, system.pairs);
  for (std::uint32_t i = 0; i < blocks; ++i) factor.add_diagonal(i, system.dense.block<6, 6>(6 * i, 6 * i));
  for (const auto& [a, b] : system.pairs) factor.add(a, b, system.dense.block<6, 6>(6 * a, 6 * b));
}

TEST(BlockCholesky, SolvesWhatADenseFactorSolves) {
  Draw draw(5);
  for (const std::size_t blocks : {1, 2, 7, 40}) {
    for (const std::size_t neighbours : {0, 2, 6}) {
      const System system = random_system(blocks, neighbours, draw);
      BlockCholesky factor;
      load(system, factor);
      ASSERT_TRUE(factor.factorise());
      Eigen::VectorXd right(system.dense.cols());
      for (double& value : right) value = draw.uniform(-1.0, 1.0);
      Eigen::VectorXd x = right;
      factor.solve(x);
      EXPECT_LT((system.dense * x - right).norm(), 1e-11 * right.norm() * static_cast<double>(blocks)) << blocks << ' ' << neighbours;
    }
  }
}

TEST(BlockCholesky, TellsWhatIsNotPositiveDefinite) {
  Draw draw(6);
  System system = random_system(12, 4, draw);
  system.dense(40, 40) = -1.0;
  BlockCholesky factor;
  load(system, factor);
  EXPECT_FALSE(factor.factorise());
}

}  // namespace
}  // namespace supple::core
