#include "integrate/step_hessian.h"

#include <Eigen/Cholesky>
#include <Eigen/IterativeLinearSolvers>
#include <algorithm>
#include <array>

#include "supple/core/interrupt.h"

namespace supple::core {
namespace {

/// Inverse of the 6x6 diagonal blocks.
class BlockJacobi {
 public:
  using StorageIndex = Eigen::SparseMatrix<double>::StorageIndex;
  enum { ColsAtCompileTime = Eigen::Dynamic, MaxColsAtCompileTime = Eigen::Dynamic };

  BlockJacobi() = default;
  template <class Matrix>
  BlockJacobi& analyzePattern(const Matrix& /*matrix*/) {
    return *this;
  }
  template <class Matrix>
  BlockJacobi& factorize(const Matrix& matrix) {
    return compute(matrix);
  }
  template <class Matrix>
  BlockJacobi& compute(const Matrix& matrix) {
    const Eigen::Index blocks = matrix.cols() / 6;
    inverse_.resize(static_cast<std::size_t>(blocks));
    for (Eigen::Index b = 0; b < blocks; ++b) {
      Mat6 block = Mat6::Zero();
      for (Eigen::Index c = 0; c < 6; ++c) {
        // The diagonal block leads its columns.
        typename Matrix::InnerIterator entry(matrix, 6 * b + c);
        for (Eigen::Index r = c; r < 6; ++r, ++entry) block(r, c) = block(c, r) = entry.value();
      }
      inverse_[static_cast<std::size_t>(b)].compute(block);
    }
    return *this;
  }
  template <class Right>
  [[nodiscard]] Eigen::VectorXd solve(const Right& right) const {
    heed_scope();  // once an iteration
    Eigen::VectorXd out(right.size());
    for (std::size_t b = 0; b < inverse_.size(); ++b) {
      const auto row = static_cast<Eigen::Index>(6 * b);
      out.segment<6>(row) = inverse_[b].solve(right.template segment<6>(row));
    }
    return out;
  }
  [[nodiscard]] static Eigen::ComputationInfo info() { return Eigen::Success; }

 private:
  std::vector<Eigen::LLT<Mat6>> inverse_;
};

}  // namespace

void StepHessian::begin(std::span<const std::uint8_t> pinned,
                        std::span<const std::pair<std::uint32_t, std::uint32_t>> pairs) {
  const bool same = pinned_.size() == pinned.size() && pairs_.size() == pairs.size() &&
                    std::equal(pairs.begin(), pairs.end(), pairs_.begin());
  pinned_.assign(pinned.begin(), pinned.end());
  if (!same || pattern_ == 0) build_pattern(pairs);
  std::fill(matrix_.valuePtr(), matrix_.valuePtr() + matrix_.nonZeros(), 0.0);
}

void StepHessian::build_pattern(std::span<const std::pair<std::uint32_t, std::uint32_t>> pairs) {
  const std::size_t n = pinned_.size();
  pairs_.assign(pairs.begin(), pairs.end());
  std::vector<std::vector<std::uint32_t>> below(n);
  for (const auto& [a, b] : pairs_) below[std::min(a, b)].push_back(std::max(a, b));
  Eigen::Index entries = 0;
  for (auto& list : below) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    entries += 21 + 36 * static_cast<Eigen::Index>(list.size());  // the lower half of the diagonal block, and whole blocks below it
  }
  const auto size = static_cast<Eigen::Index>(6 * n);
  matrix_.resize(size, size);
  matrix_.resizeNonZeros(entries);
  int entry = 0;
  for (std::size_t a = 0; a < n; ++a) {
    const int first = 6 * static_cast<int>(a);
    for (int column = first; column < first + 6; ++column) {
      matrix_.outerIndexPtr()[column] = entry;
      for (int row = column; row < first + 6; ++row) matrix_.innerIndexPtr()[entry++] = row;
      for (const std::uint32_t b : below[a]) {
        for (int r = 0; r < 6; ++r) matrix_.innerIndexPtr()[entry++] = 6 * static_cast<int>(b) + r;
      }
    }
  }
  matrix_.outerIndexPtr()[size] = entry;
  rank_.resize(pairs_.size());
  for (std::size_t k = 0; k < pairs_.size(); ++k) {
    const auto& list = below[std::min(pairs_[k].first, pairs_[k].second)];
    const std::uint32_t other = std::max(pairs_[k].first, pairs_[k].second);
    rank_[k] = static_cast<std::uint32_t>(std::lower_bound(list.begin(), list.end(), other) - list.begin());
  }
  ++pattern_;
}

bool StepHessian::held(std::uint32_t particle, int row) const {
  constexpr std::array<std::uint8_t, 6> kHolds{kPinPosition,    kPinPosition,    kPinPosition | kPlanar,
                                               kPinOrientation | kPlanar, kPinOrientation | kPlanar, kPinOrientation};
  return (pinned_[particle] & kHolds[static_cast<std::size_t>(row)]) != 0;
}

void StepHessian::add_diagonal(std::uint32_t i, const Eigen::Ref<const Mat6, 0, Eigen::OuterStride<>>& h) {
  const bool free = pinned_[i] == 0;
  for (int c = 0; c < 6; ++c) {
    if (!free && held(i, c)) continue;
    double* const column = matrix_.valuePtr() + matrix_.outerIndexPtr()[6 * static_cast<Eigen::Index>(i) + c];
    for (int r = c; r < 6; ++r) {
      if (free || !held(i, r)) column[r - c] += h(r, c);
    }
  }
}

void StepHessian::add_particle(std::uint32_t i, const Mat6& h) {
  add_diagonal(i, h);
  if (pinned_[i] == 0) return;
  for (int c = 0; c < 6; ++c) {
    if (held(i, c)) matrix_.valuePtr()[matrix_.outerIndexPtr()[6 * static_cast<Eigen::Index>(i) + c]] = 1.0;
  }
}

void StepHessian::add_pair(std::size_t index, const PairHessian& h) {
  const auto [first, second] = pairs_[index];
  add_diagonal(first, h.topLeftCorner<6, 6>());
  add_diagonal(second, h.bottomRightCorner<6, 6>());
  add_coupling(index, first < second ? Mat6(h.bottomLeftCorner<6, 6>()) : Mat6(h.topRightCorner<6, 6>()));
}

void StepHessian::add_coupling(std::size_t index, const Mat6& h) {
  const auto [low, high] = std::minmax(pairs_[index].first, pairs_[index].second);
  const bool free = pinned_[low] == 0 && pinned_[high] == 0;
  for (int c = 0; c < 6; ++c) {
    if (!free && held(low, c)) continue;
    double* const column = matrix_.valuePtr() + matrix_.outerIndexPtr()[6 * static_cast<Eigen::Index>(low) + c] +
                           (6 - c) + 6 * static_cast<std::ptrdiff_t>(rank_[index]);
    for (int r = 0; r < 6; ++r) {
      if (free || !held(high, r)) column[r] += h(r, c);
    }
  }
}

bool StepSolver::factorise(const StepHessian& hessian) {
  const Eigen::SparseMatrix<double>& matrix = hessian.matrix();
  const auto blocks = static_cast<std::uint32_t>(matrix.cols() / 6);
  if (pattern_ != hessian.pattern()) {
    factor_.analyse(blocks, hessian.pairs());
    pattern_ = hessian.pattern();
  } else {
    factor_.clear();
  }
  for (std::uint32_t a = 0; a < blocks; ++a) {
    const int* const row = matrix.innerIndexPtr() + matrix.outerIndexPtr()[6 * a];
    const int rows = matrix.outerIndexPtr()[6 * a + 1] - matrix.outerIndexPtr()[6 * a];
    Mat6 block = Mat6::Zero();
    for (int c = 0; c < 6; ++c) {
      const double* const column = matrix.valuePtr() + matrix.outerIndexPtr()[6 * static_cast<int>(a) + c];
      for (int r = c; r < 6; ++r) block(r, c) = column[r - c];
    }
    factor_.add_diagonal(a, block);
    for (int e = 6; e < rows; e += 6) {
      for (int c = 0; c < 6; ++c) {
        block.col(c) = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(matrix.valuePtr() + matrix.outerIndexPtr()[6 * static_cast<int>(a) + c] + e - c);
      }
      factor_.add(static_cast<std::uint32_t>(row[e] / 6), a, block);
    }
  }
  return factor_.factorise();
}

Eigen::VectorXd StepSolver::solve(const Eigen::VectorXd& right) const {
  Eigen::VectorXd x = right;
  factor_.solve(x);
  return x;
}

int StepSolver::solve_iteratively(const StepHessian& hessian, const Eigen::VectorXd& right, Eigen::VectorXd& x) {
  Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower, BlockJacobi> solver;
  solver.setTolerance(1e-9);
  solver.compute(hessian.matrix());
  x = solver.solve(right);
  return static_cast<int>(solver.iterations());
}

}  // namespace supple::core
