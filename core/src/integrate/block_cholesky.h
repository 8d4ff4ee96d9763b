// Cholesky factor of a sparse symmetric matrix of 6x6 blocks. Whole blocks take the place of the scalars of a right-looking method (e.g. Davis 2006,
// chapter 4). Its bits depend neither on the processor nor on a linear algebra library.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace supple::core {

using Mat6 = Eigen::Matrix<double, 6, 6>;

class BlockCholesky {
 public:
  /// Begins matrices of `blocks` diagonal blocks whose pairs (any order, repeats allowed) have a block below the diagonal.
  void analyse(std::size_t blocks, std::span<const std::pair<std::uint32_t, std::uint32_t>> pairs);
  /// Sets all blocks to zero.
  void clear();
  /// Adds to a diagonal block; its lower triangle is read.
  void add_diagonal(std::uint32_t i, const Mat6& a);
  /// Adds to the block of a pair given to `analyse`, rows of `row`, columns of `column`.
  void add(std::uint32_t row, std::uint32_t column, const Mat6& a);
  /// Replaces the matrix by its factor. @return false: it is not positive definite
  [[nodiscard]] bool factorise();
  /// Solves in place, with the factor.
  void solve(Eigen::VectorXd& x) const;

 private:
  [[nodiscard]] Mat6& below(std::uint32_t row, std::uint32_t column);
  void find_rows(const std::vector<std::vector<std::uint32_t>>& lower);
  void update(std::uint32_t column);

  std::vector<std::uint32_t> place_;   // of a block in the order of elimination
  std::vector<std::uint32_t> begin_;   // of each column in `row_` and `below_`, shape [blocks + 1]
  std::vector<std::uint32_t> row_;     // ascending in each column
  std::vector<Mat6> below_;            // of the matrix, then of its factor
  std::vector<Mat6> diagonal_;
};

}  // namespace supple::core
