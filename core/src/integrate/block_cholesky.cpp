#include "integrate/block_cholesky.h"

#include <immintrin.h>

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>

namespace supple::core {
namespace {

using Vec6 = Eigen::Matrix<double, 6, 1>;

/// Order of elimination with little fill: the block at each place.
std::vector<std::uint32_t> order_of(std::size_t blocks, std::span<const std::pair<std::uint32_t, std::uint32_t>> pairs) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(blocks + pairs.size());
  for (std::size_t i = 0; i < blocks; ++i) entries.emplace_back(static_cast<int>(i), static_cast<int>(i), 1.0);
  for (const auto& [a, b] : pairs) entries.emplace_back(static_cast<int>(std::max(a, b)), static_cast<int>(std::min(a, b)), 1.0);
  Eigen::SparseMatrix<double> pattern(static_cast<Eigen::Index>(blocks), static_cast<Eigen::Index>(blocks));
  pattern.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int> amd;
  amd(pattern.selfadjointView<Eigen::Lower>(), order);
  std::vector<std::uint32_t> out(blocks);
  for (std::size_t i = 0; i < blocks; ++i) out[i] = static_cast<std::uint32_t>(order.indices()[static_cast<Eigen::Index>(i)]);
  return out;
}

/// c -= a b^T, by columns of four and two rows.
void subtract_product(const Mat6& a, const Mat6& b, Mat6& c) {
  __m256d upper[6];
  __m128d lower[6];
  for (int k = 0; k < 6; ++k) {
    upper[k] = _mm256_loadu_pd(a.data() + 6 * k);
    lower[k] = _mm_loadu_pd(a.data() + 6 * k + 4);
  }
  for (int j = 0; j < 6; ++j) {
    double* const column = c.data() + 6 * j;
    __m256d four = _mm256_loadu_pd(column);
    __m128d two = _mm_loadu_pd(column + 4);
    for (int k = 0; k < 6; ++k) {
      const __m256d factor = _mm256_set1_pd(b(j, k));
      four = _mm256_fnmadd_pd(factor, upper[k], four);
      two = _mm_fnmadd_pd(_mm256_castpd256_pd128(factor), lower[k], two);
    }
    _mm256_storeu_pd(column, four);
    _mm_storeu_pd(column + 4, two);
  }
}

/// The lower triangle of a becomes its factor, the upper one zero. @return false: not positive definite
bool factorise_block(Mat6& a) {
  for (int j = 0; j < 6; ++j) {
    double pivot = a(j, j);
    for (int k = 0; k < j; ++k) pivot -= a(j, k) * a(j, k);
    if (!(pivot > 0.0) || !std::isfinite(pivot)) return false;
    a(j, j) = std::sqrt(pivot);
    for (int i = j + 1; i < 6; ++i) {
      double sum = a(i, j);
      for (int k = 0; k < j; ++k) sum -= a(i, k) * a(j, k);
      a(i, j) = sum / a(j, j);
      a(j, i) = 0.0;
    }
  }
  return true;
}

/// a becomes a l^-T.
void divide(const Mat6& l, Mat6& a) {
  for (int j = 0; j < 6; ++j) {
    Vec6 column = a.col(j);
    for (int k = 0; k < j; ++k) column -= l(j, k) * a.col(k);
    a.col(j) = column / l(j, j);
  }
}

}  // namespace

void BlockCholesky::analyse(std::size_t blocks, std::span<const std::pair<std::uint32_t, std::uint32_t>> pairs) {
  const std::vector<std::uint32_t> order = order_of(blocks, pairs);
  place_.resize(blocks);
  for (std::uint32_t i = 0; i < blocks; ++i) place_[order[i]] = i;
  std::vector<std::vector<std::uint32_t>> lower(blocks);
  for (const auto& [a, b] : pairs) {
    const auto [column, row] = std::minmax(place_[a], place_[b]);
    lower[column].push_back(row);
  }
  for (auto& rows : lower) {
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  }
  find_rows(lower);
  clear();
}

/// A column of the factor has the rows of the matrix, and those of the columns whose first row below the diagonal is this one.
void BlockCholesky::find_rows(const std::vector<std::vector<std::uint32_t>>& lower) {
  const std::size_t n = lower.size();
  std::vector<std::vector<std::uint32_t>> children(n);
  std::vector<std::uint32_t> merged, next;
  begin_.assign(1, 0);
  row_.clear();
  for (std::uint32_t j = 0; j < n; ++j) {
    merged = lower[j];
    for (const std::uint32_t child : children[j]) {
      next.clear();
      std::set_union(merged.begin(), merged.end(), row_.begin() + begin_[child] + 1, row_.begin() + begin_[child + 1], std::back_inserter(next));
      merged.swap(next);
    }
    if (!merged.empty()) children[merged.front()].push_back(j);
    row_.insert(row_.end(), merged.begin(), merged.end());
    begin_.push_back(static_cast<std::uint32_t>(row_.size()));
  }
}

void BlockCholesky::clear() {
  diagonal_.assign(place_.size(), Mat6::Zero());
  below_.assign(row_.size(), Mat6::Zero());
}

Mat6& BlockCholesky::below(std::uint32_t row, std::uint32_t column) {
  const auto first = row_.begin() + begin_[column], last = row_.begin() + begin_[column + 1];
  return below_[static_cast<std::size_t>(std::lower_bound(first, last, row) - row_.begin())];
}

void BlockCholesky::add_diagonal(std::uint32_t i, const Mat6& a) { diagonal_[place_[i]] += a; }

void BlockCholesky::add(std::uint32_t row, std::uint32_t column, const Mat6& a) {
  const std::uint32_t r = place_[row], c = place_[column];
  if (r > c) {
    below(r, c) += a;
  } else {
    below(c, r) += a.transpose();
  }
}

bool BlockCholesky::factorise() {
  for (std::uint32_t j = 0; j < place_.size(); ++j) {
    if (!factorise_block(diagonal_[j])) return false;
    for (std::uint32_t e = begin_[j]; e < begin_[j + 1]; ++e) divide(diagonal_[j], below_[e]);
    update(j);
  }
  return true;
}

/// Subtracts what a finished column adds to those of its rows, which have all of its later rows.
void BlockCholesky::update(std::uint32_t column) {
  const std::uint32_t end = begin_[column + 1];
  for (std::uint32_t e = begin_[column]; e < end; ++e) {
    const std::uint32_t target = row_[e];
    subtract_product(below_[e], below_[e], diagonal_[target]);
    std::uint32_t at = begin_[target];
    for (std::uint32_t f = e + 1; f < end; ++f) {
      while (row_[at] != row_[f]) ++at;
      subtract_product(below_[f], below_[e], below_[at]);
    }
  }
}

void BlockCholesky::solve(Eigen::VectorXd& x) const {
  const std::size_t n = place_.size();
  std::vector<Vec6> y(n);
  for (std::size_t i = 0; i < n; ++i) y[place_[i]] = x.segment<6>(static_cast<Eigen::Index>(6 * i));
  for (std::size_t j = 0; j < n; ++j) {
    diagonal_[j].triangularView<Eigen::Lower>().solveInPlace(y[j]);
    for (std::uint32_t e = begin_[j]; e < begin_[j + 1]; ++e) y[row_[e]] -= below_[e] * y[j];
  }
  for (std::size_t j = n; j-- > 0;) {
    for (std::uint32_t e = begin_[j]; e < begin_[j + 1]; ++e) y[j] -= below_[e].transpose() * y[row_[e]];
    diagonal_[j].transpose().triangularView<Eigen::Upper>().solveInPlace(y[j]);
  }
  for (std::size_t i = 0; i < n; ++i) x.segment<6>(static_cast<Eigen::Index>(6 * i)) = y[place_[i]];
}

}  // namespace supple::core
