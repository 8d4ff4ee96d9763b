#include "fit/solve.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "supple/core/interrupt.h"
#include "supple/core/math.h"

namespace supple::fit {
namespace {

using implicit::Field;
using implicit::FieldView;

constexpr double kIso = 0.5;
constexpr std::size_t kBlock = 128;
constexpr double kSlope = 0.78;    // of Wyvill's point at iso 0.5, times the radius of its surface
constexpr double kNormal = 0.3;    // an angle counts as this share of the spacing of samples
constexpr double kMargin = 0.1;    // of the field at points inside and outside
constexpr Eigen::Index kMost = kBlobParameters;
using Row = Eigen::Matrix<double, 1, kMost>;
using Rows = Eigen::Matrix<double, 3, kMost, Eigen::RowMajor>;
using VecX = Eigen::VectorXd;

Eigen::Index parameters(const Blob& blob) { return blob.form == Form::Ball ? 4 : kMost; }

/// The squared distance u from a shape over that where its support ends, in its own axes.
struct Relative {
  double u = 0.0;
  Vec3 gradient = Vec3::Zero();
  Mat3 second = Mat3::Zero();
  Vec3 by_size = Vec3::Zero();            ///< du by the logarithms of the axes
  Mat3 gradient_by_size = Mat3::Zero();   ///< columns
};

Relative of_ellipsoid(const Vec3& axes, const Vec3& y) {
  Relative out;
  const Vec3 inverse = axes.cwiseInverse(), z = y.cwiseProduct(inverse), w = z.cwiseProduct(inverse);
  out.u = z.squaredNorm();
  out.gradient = 2.0 * w;
  out.second = (2.0 * inverse.cwiseProduct(inverse)).asDiagonal();
  out.by_size = -2.0 * z.cwiseProduct(z);
  out.gradient_by_size = (-4.0 * w).asDiagonal();
  return out;
}

Relative of_segment(const Vec3& axes, const Vec3& y) {
  Relative out;
  const double half = axes.x(), foot = std::clamp(y.x(), -half, half), scale = 1.0 / (axes.y() * axes.y());
  const bool beside = foot == y.x();
  const Vec3 away(y.x() - foot, y.y(), y.z());
  out.u = scale * away.squaredNorm();
  out.gradient = 2.0 * scale * away;
  out.second = (2.0 * scale * Vec3(beside ? 0.0 : 1.0, 1.0, 1.0)).asDiagonal();
  out.by_size = Vec3(beside ? 0.0 : -out.gradient.x() * foot, -2.0 * out.u, 0.0);  // the foot moves with the end
  if (!beside) out.gradient_by_size(0, 0) = -2.0 * scale * foot;
  out.gradient_by_size.col(1) = -2.0 * out.gradient;
  return out;
}

/// Value of a blob at a point and its derivatives by the parameters; those of the gradient along two directions.
struct BlobRows {
  double value = 0.0;
  Rows rows = Rows::Zero();  ///< of the value, and of both slopes
};

BlobRows rows_of(const Blob& blob, const Vec3& x, const std::array<Vec3, 2>* tangents) {
  BlobRows out;
  const Mat3 q = blob.turn.toRotationMatrix();
  const Vec3 y = q.transpose() * (x - blob.centre);
  const Relative at = blob.form == Form::Segment ? of_segment(blob.axes, y) : of_ellipsoid(blob.axes, y);
  const double rest = 1.0 - at.u;
  if (!(rest > 0.0)) return out;
  out.value = rest * rest * rest;
  const double first = -3.0 * rest * rest, second = 6.0 * rest;  // of (1 - u)^3 by u
  const auto put = [&](Eigen::Index row, const Vec3& place, const Vec3& size, const Vec3& turn) {
    out.rows.row(row).segment<3>(0) = -(q * place).transpose();
    if (blob.form == Form::Ball) {
      out.rows(row, 3) = size.sum();
    } else {
      out.rows.row(row).segment<3>(3) = size.transpose();
      out.rows.row(row).segment<3>(6) = -turn.transpose();
    }
  };
  const Vec3 turned = y.cross(at.gradient);
  put(0, first * at.gradient, first * at.by_size, first * turned);
  for (Eigen::Index k = 0; tangents != nullptr && k < 2; ++k) {
    const Vec3 t = q.transpose() * (*tangents)[static_cast<std::size_t>(k)], bent = at.second * t;
    const double along = second * t.dot(at.gradient);
    put(1 + k, along * at.gradient + first * bent, along * at.by_size + first * (at.gradient_by_size.transpose() * t), along * turned + first * (t.cross(at.gradient) + y.cross(bent)));
  }
  return out;
}

/// The linearised problem: J by samples, each with the blobs that reach it.
class Problem {
 public:
  Problem(std::span<const Blob> blobs, const Targets& targets, const SolveOptions& options, const Executor& executor) : targets_(targets), executor_(executor) {
    for (const Vec3& n : targets.surface.normal) {
      const Vec3 t = n.unitOrthogonal();
      tangent_.push_back({t, n.cross(t)});
    }
    points_ = targets.surface.position;
    scale_.resize(points_.size());
    for (const SignPoints* signs : {&targets.inside, &targets.outside}) {
      points_.insert(points_.end(), signs->position.begin(), signs->position.end());
      scale_.insert(scale_.end(), signs->weight.begin(), signs->weight.end());
    }
    first_parameter_.resize(blobs.size() + 1, 0);
    for (std::size_t k = 0; k < blobs.size(); ++k) {
      const bool fixed = !options.fixed.empty() && options.fixed[k] != 0;
      first_parameter_[k + 1] = first_parameter_[k] + (fixed ? 0 : parameters(blobs[k]));
    }
  }

  [[nodiscard]] Eigen::Index parameter_count() const { return first_parameter_.back(); }
  [[nodiscard]] Eigen::Index row_count() const { return 3 * static_cast<Eigen::Index>(points_.size()); }

  /// Residuals, three for each point. @param fresh  take the slopes by which they are divided from this field
  VecX residuals(std::span<const Blob> blobs, bool fresh) {
    Field field;
    build_field(blobs, field);
    VecX out = VecX::Zero(row_count());
    const std::size_t surface = targets_.surface.position.size();
    value_.resize(points_.size());
    gradient_.resize(points_.size());
    executor_.for_blocks(points_.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      const std::size_t n = end - begin;
      FieldView(field).evaluate(std::span(points_).subspan(begin, n), std::span(value_).subspan(begin, n), std::span(gradient_).subspan(begin, n));
      for (std::size_t s = begin; s < end; ++s) {
        const auto row = 3 * static_cast<Eigen::Index>(s);
        if (s < surface) {
          if (fresh) scale_[s] = 1.0 / std::max(gradient_[s].norm(), 0.5 * kSlope / targets_.size[s]);
          out[row] = scale_[s] * value_[s];
          const double angle = kNormal * targets_.surface.spacing * scale_[s];
          out[row + 1] = angle * tangent_[s][0].dot(gradient_[s]);
          out[row + 2] = angle * tangent_[s][1].dot(gradient_[s]);
        } else {
          const double side = s < surface + targets_.inside.position.size() ? -1.0 : 1.0;
          out[row] = side * scale_[s] * std::max(kMargin + side * value_[s], 0.0);
        }
      }
    });
    return out;
  }

  /// J at the blobs of the last fresh residuals.
  void linearise(std::span<const Blob> blobs, const VecX& residual) {
    Field field;
    build_field(blobs, field);
    const std::size_t blocks = (points_.size() + kBlock - 1) / kBlock;
    std::vector<implicit::FieldParts> parts(blocks);
    executor_.for_blocks(points_.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      FieldView(field).evaluate_parts(std::span(points_).subspan(begin, end - begin), parts[begin / kBlock]);
    });
    first_entry_.assign(1, 0);
    blob_.clear();
    for (const implicit::FieldParts& block : parts) {
      for (std::size_t i = 0; i + 1 < block.offset.size(); ++i) {
        const std::size_t s = first_entry_.size() - 1;
        const bool idle = s >= targets_.surface.position.size() && residual[3 * static_cast<Eigen::Index>(s)] == 0.0;
        for (std::uint32_t e = block.offset[i]; !idle && e < block.offset[i + 1]; ++e) {
          if (range(block.part[e]).second > 0) blob_.push_back(block.part[e]);
        }
        first_entry_.push_back(static_cast<std::uint32_t>(blob_.size()));
      }
    }
    fill_rows(blobs);
    gather_by_blob(blobs.size());
  }

  /// J x
  [[nodiscard]] VecX times(const VecX& x) const {
    VecX out(row_count());
    executor_.for_blocks(points_.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      for (std::size_t s = begin; s < end; ++s) {
        Vec3 sum = Vec3::Zero();
        for (std::uint32_t e = first_entry_[s]; e < first_entry_[s + 1]; ++e) {
          const auto [at, n] = range(blob_[e]);
          sum.noalias() += rows_[e].leftCols(n) * x.segment(at, n);
        }
        out.segment<3>(3 * static_cast<Eigen::Index>(s)) = sum;
      }
    });
    return out;
  }

  /// J^T y
  [[nodiscard]] VecX transposed_times(const VecX& y) const {
    VecX out(parameter_count());
    executor_.for_blocks(first_of_blob_.size() - 1, kBlobs, [&](std::size_t begin, std::size_t end) {
      for (std::size_t b = begin; b < end; ++b) {
        const auto [at, n] = range(static_cast<std::uint32_t>(b));
        Eigen::Matrix<double, kMost, 1> sum = Eigen::Matrix<double, kMost, 1>::Zero();
        for (std::uint32_t k = first_of_blob_[b]; k < first_of_blob_[b + 1]; ++k) {
          sum.noalias() += rows_[of_blob_[k]].transpose() * y.segment<3>(3 * static_cast<Eigen::Index>(sample_[of_blob_[k]]));
        }
        out.segment(at, n) = sum.head(n);
      }
    });
    return out;
  }

  using Square = Eigen::Matrix<double, kMost, kMost>;
  /// The diagonal blocks of J^T J.
  [[nodiscard]] std::vector<Square> blocks() const {
    std::vector<Square> out(first_of_blob_.size() - 1);
    executor_.for_blocks(out.size(), kBlobs, [&](std::size_t begin, std::size_t end) {
      for (std::size_t b = begin; b < end; ++b) {
        out[b].setZero();
        for (std::uint32_t k = first_of_blob_[b]; k < first_of_blob_[b + 1]; ++k) out[b].noalias() += rows_[of_blob_[k]].transpose() * rows_[of_blob_[k]];
      }
    });
    return out;
  }

  /// First parameter of a blob and their number.
  [[nodiscard]] std::pair<Eigen::Index, Eigen::Index> range(std::uint32_t blob) const {
    return {first_parameter_[blob], first_parameter_[blob + 1] - first_parameter_[blob]};
  }

 private:
  static constexpr std::size_t kBlobs = 16;

  void fill_rows(std::span<const Blob> blobs) {
    rows_.resize(blob_.size());
    sample_.resize(blob_.size());
    const std::size_t surface = targets_.surface.position.size();
    executor_.for_blocks(points_.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      for (std::size_t s = begin; s < end; ++s) {
        const bool on = s < surface;
        const Vec3 weight(1.0, on ? kNormal * targets_.surface.spacing : 0.0, on ? kNormal * targets_.surface.spacing : 0.0);
        for (std::uint32_t e = first_entry_[s]; e < first_entry_[s + 1]; ++e) {
          rows_[e] = (scale_[s] * weight).asDiagonal() * rows_of(blobs[blob_[e]], points_[s], on ? &tangent_[s] : nullptr).rows;
          sample_[e] = static_cast<std::uint32_t>(s);
        }
      }
    });
  }

  void gather_by_blob(std::size_t blobs) {
    first_of_blob_.assign(blobs + 1, 0);
    for (const std::uint32_t b : blob_) ++first_of_blob_[b + 1];
    for (std::size_t b = 0; b < blobs; ++b) first_of_blob_[b + 1] += first_of_blob_[b];
    std::vector<std::uint32_t> next(first_of_blob_.begin(), first_of_blob_.end() - 1);
    of_blob_.resize(blob_.size());
    for (std::uint32_t e = 0; e < blob_.size(); ++e) of_blob_[next[blob_[e]]++] = e;
  }

  const Targets& targets_;
  const Executor& executor_;
  std::vector<std::array<Vec3, 2>> tangent_;
  std::vector<Vec3> points_;
  std::vector<Eigen::Index> first_parameter_;
  std::vector<double> value_, scale_;
  std::vector<Vec3> gradient_;
  std::vector<std::uint32_t> first_entry_, blob_, sample_;  // entries of J by sample
  std::vector<Rows> rows_;
  std::vector<std::uint32_t> first_of_blob_, of_blob_;      // the same by blob
};

/// The step of least |J x + r|^2 + damping |D x|^2, with D^2 the diagonal of J^T J, to a few per cent.
VecX damped_step(const Problem& problem, const VecX& residual, double damping) {
  std::vector<Problem::Square> blocks = problem.blocks();
  VecX diagonal(problem.parameter_count());
  std::vector<Eigen::LLT<Problem::Square>> inverse(blocks.size());
  for (std::uint32_t b = 0; b < blocks.size(); ++b) {
    const auto [at, n] = problem.range(b);
    constexpr double kLeast = 1e-9;
    diagonal.segment(at, n) = damping * (blocks[b].diagonal().head(n).array() + kLeast);
    blocks[b].diagonal().head(n) += diagonal.segment(at, n);
    blocks[b].diagonal().tail(kMost - n).setOnes();
    inverse[b].compute(blocks[b]);
  }
  const auto precondition = [&](const VecX& v) {
    VecX out(v.size());
    for (std::uint32_t b = 0; b < blocks.size(); ++b) {
      const auto [at, n] = problem.range(b);
      Eigen::Matrix<double, kMost, 1> part = Eigen::Matrix<double, kMost, 1>::Zero();
      part.head(n) = v.segment(at, n);
      out.segment(at, n) = inverse[b].solve(part).head(n);
    }
    return out;
  };
  VecX x = VecX::Zero(problem.parameter_count());
  VecX rest = -problem.transposed_times(residual);
  VecX z = precondition(rest), direction = z;
  double product = rest.dot(z);
  const double enough = 1e-4 * product;
  constexpr int kMostSteps = 30;
  for (int step = 0; step < kMostSteps && product > enough; ++step) {
    const VecX image = problem.transposed_times(problem.times(direction)) + diagonal.cwiseProduct(direction);
    const double length = product / direction.dot(image);
    x += length * direction;
    rest -= length * image;
    z = precondition(rest);
    const double next = rest.dot(z);
    direction = z + next / product * direction;
    product = next;
  }
  return x;
}

/// Sizes of a blob within the options; none is much longer than thin but a segment.
void limit_sizes(Blob& blob, const SolveOptions& options) {
  constexpr double kMostRatio = 4.0, kShortest = 0.05;  // of segments, over the radius
  if (blob.form == Form::Segment) {
    const double radius = std::clamp(blob.axes.y(), options.smallest, options.largest), shortest = kShortest * radius;
    blob.axes = Vec3(std::clamp(blob.axes.x(), shortest, std::max(shortest, kPointRadius * (options.largest - radius))), radius, radius);
    return;
  }
  blob.axes = blob.axes.cwiseMax(options.smallest).cwiseMin(options.largest);
  blob.axes = blob.axes.cwiseMax(blob.axes.maxCoeff() / kMostRatio);
}

std::vector<Blob> moved_all(std::span<const Blob> blobs, const Problem& problem, const VecX& step, const SolveOptions& options) {
  std::vector<Blob> out(blobs.begin(), blobs.end());
  for (std::uint32_t b = 0; b < out.size(); ++b) {
    const auto [at, n] = problem.range(b);
    BlobStep own = BlobStep::Zero();
    own.head(n) = step.segment(at, n);
    if (n > 0) out[b] = moved(out[b], own, options);
  }
  return out;
}

/// Derivative of f by the logarithm of the thickness, from its gradient.
double slope_of_size(const Blob& blob, const Vec3& x, const Vec3& gradient) {
  Vec3 from = x - blob.centre;
  if (blob.form == Form::Segment) {
    const Vec3 along = blob.turn * Vec3::UnitX();
    from -= std::clamp(from.dot(along), -blob.axes.x(), blob.axes.x()) * along;
  }
  return -gradient.dot(from);
}

}  // namespace

BlobValue value_of(const Blob& blob, const Vec3& x) {
  const BlobRows at = rows_of(blob, x, nullptr);
  return {at.value, at.rows.row(0).transpose()};
}

Blob moved(const Blob& blob, const BlobStep& step, const SolveOptions& options) {
  constexpr double kFarthest = 0.3, kMostGrowth = 0.3, kMostTurn = 0.5;
  Blob out = blob;
  Vec3 shift = step.segment<3>(0);
  const double farthest = kFarthest * (blob.form == Form::Segment ? blob.axes.y() : blob.axes.minCoeff());
  if (shift.norm() > farthest) shift *= farthest / shift.norm();
  out.centre += shift;
  const Vec3 growth = (blob.form == Form::Ball ? Vec3(Vec3::Constant(step[3])) : Vec3(step.segment<3>(3))).cwiseMax(-kMostGrowth).cwiseMin(kMostGrowth);
  out.axes = blob.axes.cwiseProduct(growth.unaryExpr([](double g) { return math::exp(g); }));
  limit_sizes(out, options);
  if (blob.form == Form::Ball) return out;
  Vec3 turn = step.segment<3>(6);
  if (turn.norm() > kMostTurn) turn *= kMostTurn / turn.norm();
  const Vec3 half = 0.5 * turn;
  out.turn = (blob.turn * Quat(1.0, half.x(), half.y(), half.z())).normalized();
  return out;
}

implicit::Skeleton skeleton_of(std::span<const Blob> blobs) {
  implicit::Skeleton out;
  out.part_count = static_cast<std::uint32_t>(blobs.size());
  out.iso = kIso;
  for (std::uint32_t k = 0; k < blobs.size(); ++k) {
    const Blob& blob = blobs[k];
    implicit::Primitive primitive;
    primitive.part = k;
    primitive.offset = {blob.centre, blob.turn};
    primitive.kernel = implicit::Kernel::wyvill(blob.form == Form::Segment ? blob.axes.y() : blob.axes.minCoeff());
    if (blob.form == Form::Segment) {
      primitive.shape = implicit::ShapeKind::Segment;
      primitive.size = Vec3(blob.axes.x(), 0.0, 0.0);
    } else if (blob.form == Form::Ellipsoid) {
      primitive.shape = implicit::ShapeKind::Ellipsoid;
      primitive.size = blob.axes;
    }
    out.primitive.push_back(primitive);
  }
  return out;
}

void build_field(std::span<const Blob> blobs, Field& field) {
  const implicit::Skeleton skeleton = skeleton_of(blobs);
  const std::vector<Pose> poses(blobs.size());
  implicit::PlacedSkeleton placed;
  implicit::place_skeleton(skeleton, poses, placed);
  implicit::index_field(skeleton, placed, field);
}

void balance(std::vector<Blob>& blobs, const Targets& targets, const SolveOptions& options, const Executor& executor) {
  constexpr int kSweeps = 12;
  const std::vector<Vec3>& points = targets.surface.position;
  std::vector<implicit::FieldParts> parts((points.size() + kBlock - 1) / kBlock);
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    heed_scope();
    Field field;
    build_field(blobs, field);
    executor.for_blocks(points.size(), kBlock, [&](std::size_t begin, std::size_t end) {
      FieldView(field).evaluate_parts(std::span(points).subspan(begin, end - begin), parts[begin / kBlock]);
    });
    std::vector<double> error(blobs.size(), 0.0), slope(blobs.size(), 0.0), own;
    for (std::size_t s = 0; s < points.size(); ++s) {
      const implicit::FieldParts& block = parts[s / kBlock];
      const std::size_t first = block.offset[s % kBlock], last = block.offset[s % kBlock + 1];
      double value = -kIso, all = 0.0;
      own.clear();
      for (std::size_t e = first; e < last; ++e) {
        value += block.value[e];
        own.push_back(slope_of_size(blobs[block.part[e]], points[s], block.gradient[e]));
        all += own.back();
      }
      for (std::size_t e = first; e < last; ++e) {
        error[block.part[e]] += own[e - first] * value;
        slope[block.part[e]] += own[e - first] * all;
      }
    }
    for (std::size_t b = 0; b < blobs.size(); ++b) {
      constexpr double kMostChange = 0.2;
      if (!(slope[b] > 0.0) || (!options.fixed.empty() && options.fixed[b] != 0)) continue;
      const double change = std::clamp(-error[b] / slope[b], -kMostChange, kMostChange);
      if (blobs[b].form == Form::Segment) {
        blobs[b].axes.tail<2>() *= 1.0 + change;
      } else {
        blobs[b].axes *= 1.0 + change;
      }
      limit_sizes(blobs[b], options);
    }
  }
}

double solve(std::vector<Blob>& blobs, const Targets& targets, const SolveOptions& options, const Executor& executor) {
  Problem problem(blobs, targets, options, executor);
  constexpr double kFirstDamping = 0.01, kLeastDamping = 1e-5, kMostDamping = 1e4;
  double damping = kFirstDamping;
  VecX residual;
  for (int k = 0; k < options.iterations && damping < kMostDamping; ++k) {
    heed_scope();
    residual = problem.residuals(blobs, true);
    const double cost = residual.squaredNorm();
    problem.linearise(blobs, residual);
    for (; damping < kMostDamping; damping *= 10.0) {
      std::vector<Blob> tried = moved_all(blobs, problem, damped_step(problem, residual, damping), options);
      if (!(problem.residuals(tried, false).squaredNorm() < cost)) continue;
      blobs = std::move(tried);
      damping = std::max(kLeastDamping, 0.2 * damping);
      break;
    }
  }
  residual = problem.residuals(blobs, true);
  double squares = 0.0;
  const auto n = static_cast<Eigen::Index>(targets.surface.position.size());
  for (Eigen::Index s = 0; s < n; ++s) squares += residual[3 * s] * residual[3 * s];
  return std::sqrt(squares / static_cast<double>(n));
}

}  // namespace supple::fit
