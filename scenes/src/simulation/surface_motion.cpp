#include "simulation/surface_motion.h"

#include <algorithm>
#include <cmath>

#include "simulation/held_volumes.h"
#include "supple/core/integrate.h"
#include "supple/implicit/mesh_motion.h"

namespace supple::scenes {
namespace {

/// Between now and a moment before or after a body changes by about this share of its smallest feature: the difference then errs by some
/// 1e-10 of itself.
constexpr double kStride = 1e-5;

/// A body whose field changes by more than rigid motion of its parts.
class ChangingBody {
 public:
  ChangingBody(const Model& model, const State& state, const Body& body, std::span<const implicit::PartMotion> parts)
      : model_(model), state_(state), body_(body), object_(model.objects[body.object]), parts_(parts) {
    for (std::size_t k = 0; object_.holds_volume && k < object_.target.size(); ++k) {
      rate_ = std::max(rate_, std::abs(state.volumes[object_.first_volume + k].rate));
    }
    for (std::size_t k = 0; k < state.broken_for.size(); ++k) {
      if (fades(k)) rate_ = std::max(rate_, 1.0 / object_.fade);
    }
  }
  [[nodiscard]] bool any() const { return rate_ > 0.0; }

  /// In which the surface moves by about that length, or the kernels change by that much [s].
  [[nodiscard]] double time_for(double length) const {
    double speed = rate_ * length / kStride;
    for (const implicit::Primitive& primitive : body_.skeleton.primitive) {
      const implicit::PartMotion& part = parts_[primitive.part];
      const Box support = implicit::support_box(primitive);
      const double reach = primitive.offset.position.norm() + support.lower.cwiseAbs().cwiseMax(support.upper.cwiseAbs()).norm();
      speed = std::max(speed, part.velocity.norm() + reach * part.angular_velocity.norm());
    }
    return length / speed;
  }

  /// The field at a time from now [s], extrapolated from its present rate of change.
  void place_in(double time, std::span<const Pose> now, implicit::Field& field) const {
    std::vector<Body> then(1);
    then.front().object = body_.object;
    then.front().particle = body_.particle;
    then.front().skeleton = body_.skeleton;
    std::vector<double> broken_for = state_.broken_for;
    for (std::size_t k = 0; k < broken_for.size(); ++k) {
      if (fades(k)) broken_for[k] += time;
    }
    fade_blends(model_, state_.links, broken_for, then);
    std::vector<implicit::VolumeState> volumes = state_.volumes;
    for (implicit::VolumeState& volume : volumes) volume.scale *= 1.0 + time * volume.rate;
    scale_kernels(model_, volumes, then);
    std::vector<Pose> poses(now.begin(), now.end());
    for (std::size_t k = 0; k < poses.size(); ++k) {
      poses[k].position += time * parts_[k].velocity;
      poses[k].orientation = (core::rotation_exp(time * parts_[k].angular_velocity) * poses[k].orientation).normalized();
    }
    implicit::PlacedSkeleton placed;
    implicit::place_skeleton(then.front().skeleton, poses, placed);
    implicit::index_field(then.front().skeleton, placed, field);
  }

 private:
  [[nodiscard]] bool fades(std::size_t link) const {
    return model_.particles.object[model_.links.first[link]] == body_.object && state_.links.broken[link] != 0 &&
           state_.broken_for[link] < object_.fade;
  }

  const Model& model_;
  const State& state_;
  const Body& body_;
  const ObjectModel& object_;
  std::span<const implicit::PartMotion> parts_;
  double rate_ = 0.0;  ///< of kernels and blends [1/s]
};

}  // namespace

void add_surface_motion(const StageContext& context, const State& state, std::size_t body, const Frame& frame, Mesh& mesh) {
  const Body& own = context.bodies[body];
  std::vector<implicit::PartMotion> parts(own.particle.size());
  for (std::size_t k = 0; k < parts.size(); ++k) {
    parts[k] = {.centre = frame.pose[body][k].position, .velocity = frame.velocity[body][k],
                .angular_velocity = frame.spin[body][k], .id = own.particle[k]};
  }
  const implicit::FieldView field = frame.field[body];
  const ChangingBody changing(context.model, state, own, parts);
  if (!changing.any()) {
    implicit::add_motion(field, parts, context.executor, mesh);
    return;
  }
  const double apart = changing.time_for(kStride * field.feature_size());
  implicit::Field before, after;
  changing.place_in(-apart, frame.pose[body], before);
  changing.place_in(apart, frame.pose[body], after);
  const implicit::FieldMoments moments{before, after, 2.0 * apart};
  implicit::add_motion(field, parts, context.executor, mesh, &moments);
}

}  // namespace supple::scenes
