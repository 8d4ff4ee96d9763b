#include "supple/collision/soft_body.h"

#include <algorithm>
#include <utility>

#include "numbers.h"
#include "supple/collision/find_contacts.h"
#include "supple/collision/react.h"
#include "supple/core/error.h"
#include "supple/implicit/surface_samples.h"

namespace supple::collision {

struct SoftBody::Impl {
  implicit::Skeleton skeleton;
  ContactMaterial material;
  std::vector<Pose> pose;
  std::vector<Vec3> velocity, angular_velocity;
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  implicit::SampleLayout layout;
  implicit::SampleState distances;
  implicit::SurfaceSamples samples;

  void place();
};

void SoftBody::Impl::place() {
  place_skeleton(skeleton, pose, placed);
  index_field(skeleton, placed, field);
  // From the poses alone, so that the way by which a body came here changes nothing.
  distances = {};
  const Executor executor;
  sample_surface({skeleton, layout, pose, field}, {}, executor, distances, samples);
}

SoftBody::SoftBody(implicit::Skeleton skeleton, ContactMaterial material, std::vector<Pose> pose) : impl_(std::make_unique<Impl>()) {
  SUPPLE_EXPECTS(!skeleton.primitive.empty() && material.modulus > 0.0);
  SUPPLE_EXPECTS(pose.size() == skeleton.part_count);
  constexpr double kSamplesAcross = 6.0;  // as scenes have them: seeds of every patch as wide as a sixth of the thinnest part
  impl_->skeleton = std::move(skeleton);
  impl_->material = material;
  impl_->pose = std::move(pose);
  impl_->velocity.assign(impl_->pose.size(), Vec3::Zero());
  impl_->angular_velocity = impl_->velocity;
  double thinnest = kInfinity;
  for (const implicit::Primitive& primitive : impl_->skeleton.primitive) {
    const double distance = implicit::iso_distance(primitive.kernel, impl_->skeleton.iso);
    thinnest = std::min(thinnest, (distance > 0.0 ? distance : primitive.kernel.radius) / implicit::distance_scale(primitive));
  }
  impl_->layout = implicit::make_sample_layout(impl_->skeleton, 2.0 * thinnest / kSamplesAcross);
  impl_->place();
}

SoftBody::~SoftBody() = default;
SoftBody::SoftBody(SoftBody&&) noexcept = default;
SoftBody& SoftBody::operator=(SoftBody&&) noexcept = default;

void SoftBody::move(std::vector<Pose> pose) {
  SUPPLE_EXPECTS(pose.size() == impl_->pose.size());
  impl_->pose = std::move(pose);
  impl_->place();
}

void SoftBody::set_motion(std::vector<Vec3> velocity, std::vector<Vec3> angular_velocity) {
  SUPPLE_EXPECTS(velocity.size() == impl_->pose.size() && angular_velocity.size() == impl_->pose.size());
  impl_->velocity = std::move(velocity);
  impl_->angular_velocity = std::move(angular_velocity);
}

const implicit::Field& SoftBody::field() const { return impl_->field; }
const std::vector<Pose>& SoftBody::pose() const { return impl_->pose; }

ContactBody SoftBody::view() const {
  double core = kInfinity;
  for (const implicit::Primitive& primitive : impl_->skeleton.primitive) core = std::min(core, implicit::peak(primitive.kernel) - impl_->skeleton.iso);
  return {.field = impl_->field,
          .material = impl_->material,
          .pose = impl_->pose,
          .velocity = impl_->velocity,
          .angular_velocity = impl_->angular_velocity,
          .samples = &impl_->samples,
          .skeleton = &impl_->skeleton,
          .yield = {},
          .core_value = core};
}

Touch touch(const ContactBody& a, const ContactBody& b, double error) {
  SUPPLE_EXPECTS(error >= 1e-10 && error <= 0.1);
  const std::array bodies{a, b};
  Touch out;
  for (std::size_t i = 0; i < 2; ++i) {
    out.loads[i].force.assign(bodies[i].pose.size(), Vec3::Zero());
    out.loads[i].torque = out.loads[i].force;
  }
  const Executor executor;
  ContactCandidates candidates;
  find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
  solve_contact_surface(bodies, candidates, {.error = error}, executor, out.surface);
  react({bodies, {}, out.surface}, executor, {out.loads});
  return out;
}

Touch touch(const SoftBody& a, const SoftBody& b, double error) { return touch(a.view(), b.view(), error); }

}  // namespace supple::collision
