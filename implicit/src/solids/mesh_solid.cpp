#include "supple/implicit/mesh_solid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <utility>
#include <vector>

#include "field/single_part.h"
#include "solids/mesh_distance.h"
#include "supple/core/error.h"

namespace supple::implicit {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// Corners of their own for every face, with its normal.
Mesh flat_faces(const ClosedSurface& surface, const Pose& pose) {
  Mesh flat;
  const Mat3 turn = pose.orientation.toRotationMatrix();
  for (const auto& triangle : surface.triangle) {
    const Vec3 &a = surface.position[triangle[0]], &b = surface.position[triangle[1]], &c = surface.position[triangle[2]];
    const Vec3 normal = turn * (b - a).cross(c - a).normalized();
    const auto first = static_cast<std::uint32_t>(flat.position.size());
    flat.triangle.push_back({first, first + 1, first + 2});
    for (const Vec3* x : {&a, &b, &c}) {
      flat.position.push_back(pose.position + turn * *x);
      flat.normal.push_back(normal);
    }
  }
  return flat;
}

bool equal(const ClosedSurface& a, const ClosedSurface& b) {
  // What crosses is cut into pieces: those of different meshes may be the same.
  return a.crossing_before == 0 && b.crossing_before == 0 && a.turned == b.turned && a.position == b.position && a.triangle == b.triangle;
}

/// Solids of one mesh share its distance as long as one of them lives: every simulation of a run has the solids of its scene.
std::shared_ptr<const MeshDistance> distance_to(ClosedSurface surface) {
  static std::mutex mutex;
  static std::vector<std::weak_ptr<const MeshDistance>> alive;
  {
    const std::lock_guard lock(mutex);
    std::erase_if(alive, [](const auto& one) { return one.expired(); });
    for (const auto& one : alive) {
      if (auto distance = one.lock(); distance && equal(distance->exact().surface(), surface)) return distance;
    }
  }
  auto made = std::make_shared<const MeshDistance>(std::move(surface));
  const std::lock_guard lock(mutex);
  alive.push_back(made);
  return made;
}

}  // namespace

MeshSolid::MeshSolid(const Mesh& mesh, const MeshSolidOptions& options)
    : position_(options.pose.position), rotation_(options.pose.orientation.toRotationMatrix()), slope_(options.slope) {
  SUPPLE_EXPECTS(options.slope > 0.0);
  distance_ = distance_to(closed_surface(mesh));
  const ClosedSurface& surface = distance_->exact().surface();
  mesh_ = std::make_shared<const Mesh>(flat_faces(surface, options.pose));
  const Box inside = distance_->inside_box();
  const Vec3 middle = options.pose.to_world(inside.centre()), reach = 0.5 * rotation_.cwiseAbs() * inside.extent();
  box_ = Box{middle - reach, middle + reach}.inflated(16.0 * kEpsilon * (middle.cwiseAbs() + reach).maxCoeff());
  constexpr double kThinner = 0.01, kPart = 1.0 / 16.0;  // share of the area; of the longest side
  const Vec3 extent = distance_->exact().box().extent();
  deepest_ = -distance_->range().lower;
  const double most = kPart * extent.maxCoeff();
  feature_size_ = std::min(distance_->exact().thickness(kThinner, most), most);
  report_ = {surface.turned, surface.crossing_before, surface.deviation + distance_->deviation(), extent.maxCoeff()};
}

double MeshSolid::evaluate(const Vec3& point, Vec3* gradient) const {
  const Vec3 local = rotation_.transpose() * (point - position_);
  if (gradient == nullptr) return -slope_ * distance_->at(local, nullptr);
  Vec3 slope;
  const double distance = distance_->at(local, &slope);
  *gradient = -slope_ * (rotation_ * slope);
  return -slope_ * distance;
}

void MeshSolid::evaluate(std::span<const Vec3> points, std::span<double> values) const {
  SUPPLE_EXPECTS(points.size() == values.size());
  for (std::size_t i = 0; i < points.size(); ++i) values[i] = evaluate(points[i], nullptr);
}

void MeshSolid::evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
  SUPPLE_EXPECTS(points.size() == values.size() && points.size() == gradients.size());
  for (std::size_t i = 0; i < points.size(); ++i) values[i] = evaluate(points[i], &gradients[i]);
}

void MeshSolid::evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const { evaluate_single_part(*this, points, parts); }

Interval MeshSolid::bound(const Box& box) const {
  const double most = slope_ * deepest_, least = -slope_ * distance_->range().upper * (1.0 + 1e-6);
  if (!box.lower.allFinite() || !box.upper.allFinite()) return {least, most};
  const double way = gradient_bound(box) * 0.5 * box.extent().norm();
  const double value = evaluate(box.centre(), nullptr);
  const double scale = slope_ * (box.centre().norm() + position_.norm() + distance_->exact().box().lower.norm() + distance_->exact().box().upper.norm()) + way;
  const double round_off = 16.0 * kEpsilon * scale;
  return {std::max(value - way, least) - round_off, std::min(value + way, most) + round_off};
}

double MeshSolid::gradient_bound(const Box& box) const {
  if (!box.lower.allFinite() || !box.upper.allFinite()) return slope_ * distance_->steepest(distance_->exact().box());
  const Vec3 centre = rotation_.transpose() * (box.centre() - position_), half = 0.5 * rotation_.cwiseAbs().transpose() * box.extent();
  return slope_ * distance_->steepest({centre - half, centre + half});
}

}  // namespace supple::implicit
