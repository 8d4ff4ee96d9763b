// A ball, made of one primitive, is pressed 5 cm into a plane: the forces on both bodies.
#include <supple/collision/find_contacts.h>
#include <supple/collision/react.h>
#include <supple/implicit/field.h>
#include <supple/implicit/solids.h>

#include <array>
#include <iostream>

using namespace supple;

int main() {
  implicit::Skeleton skeleton{.part_count = 1};
  skeleton.primitive.resize(1);
  skeleton.primitive[0].kernel = implicit::Kernel::wyvill(1.0);
  skeleton.iso = 0.5;
  const Pose ball_pose{.position = Vec3(0, 0, implicit::iso_distance(skeleton.primitive[0].kernel, 0.5) - 0.05)}, ground_pose;
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  place_skeleton(skeleton, {&ball_pose, 1}, placed);
  index_field(skeleton, placed, field);
  const implicit::HalfSpace ground{.normal = Vec3::UnitZ()};

  const std::array<collision::ContactBody, 2> bodies{{{.field = field, .material = {.modulus = 2e4}, .pose = {&ball_pose, 1}},
                                                      {.field = ground, .pose = {&ground_pose, 1}, .fixed = true}}};
  const Executor executor;
  collision::ContactCandidates candidates;
  collision::ContactSurface surface;
  find_contacts(bodies, collision::broad_phase(bodies, {}, executor), executor, candidates);
  solve_contact_surface(bodies, candidates, {.error = 1e-3}, executor, surface);
  std::array<collision::PartLoads, 2> loads;
  for (collision::PartLoads& body : loads) body = {.force = {Vec3::Zero()}, .torque = {Vec3::Zero()}};
  collision::react({bodies, {}, surface}, executor, {loads});
  if (surface.summary.empty()) return 1;
  std::cout << loads[0].force[0].transpose() << " N, within " << 100.0 * surface.summary[0].error_estimate << " %\n";
  return loads[0].force[0].z() > 0.0 && loads[0].force[0] == -loads[1].force[0] ? 0 : 1;
}
