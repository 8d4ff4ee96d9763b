// The linear systems of implicit steps: a symmetric matrix of 6x6 blocks, one row of blocks a particle.
#pragma once

#include <Eigen/SparseCore>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "integrate/block_cholesky.h"
#include "supple/core/pair_hessian.h"
#include "supple/core/particles.h"

namespace supple::core {

/// Lower triangle, columns compressed. Unknowns that a pin holds have a row and a column of the identity.
class StepHessian {
 public:
  /// Begins a matrix of `particles` diagonal blocks with these pairs; keeps the pattern when the pairs are the last ones.
  void begin(std::span<const std::uint8_t> pinned, std::span<const std::pair<std::uint32_t, std::uint32_t>> pairs);
  /// @param h  symmetric; rows are displacement and rotation
  void add_particle(std::uint32_t i, const Mat6& h);
  /// The Hessian of pair `index` of the list given to `begin`.
  void add_pair(std::size_t index, const PairHessian& h);
  /// Only what couples the two particles of pair `index`. @param h  rows of the particle with the larger number
  void add_coupling(std::size_t index, const Mat6& h);
  [[nodiscard]] const Eigen::SparseMatrix<double>& matrix() const { return matrix_; }
  [[nodiscard]] std::span<const std::pair<std::uint32_t, std::uint32_t>> pairs() const { return pairs_; }
  /// Raised whenever the pattern changes.
  [[nodiscard]] std::uint64_t pattern() const { return pattern_; }

 private:
  void build_pattern(std::span<const std::pair<std::uint32_t, std::uint32_t>> pairs);
  [[nodiscard]] bool held(std::uint32_t particle, int row) const;
  void add_diagonal(std::uint32_t i, const Eigen::Ref<const Mat6, 0, Eigen::OuterStride<>>& h);

  Eigen::SparseMatrix<double> matrix_;
  std::vector<std::uint8_t> pinned_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs_;
  std::vector<std::uint32_t> rank_;  ///< of the pair's block in its column, by pair
  std::uint64_t pattern_ = 0;
};

/// Solves with the matrix: a Cholesky factor, or conjugate gradients with the inverse diagonal blocks.
class StepSolver {
 public:
  /// False when the matrix is not positive definite.
  [[nodiscard]] bool factorise(const StepHessian& hessian);
  [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& right) const;
  /// @return iterations
  static int solve_iteratively(const StepHessian& hessian, const Eigen::VectorXd& right, Eigen::VectorXd& x);

 private:
  BlockCholesky factor_;
  std::uint64_t pattern_ = 0;
};

}  // namespace supple::core
