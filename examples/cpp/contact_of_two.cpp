// Contact of two bodies without a scene: a ball on a ring, at which it is not convex.
#include <supple/collision/soft_body.h>

#include <iostream>

using namespace supple;

int main() {
  implicit::Skeleton ring{.part_count = 1}, ball{.part_count = 1};
  ring.primitive.push_back({.shape = implicit::ShapeKind::Ring, .size = Vec3(0.4, 0, 0), .kernel = implicit::Kernel::wyvill(0.25)});
  ball.primitive.push_back({.kernel = implicit::Kernel::wyvill(0.8)});
  const collision::SoftBody below(ring, {.modulus = 2e4}, {Pose{}});
  const collision::SoftBody above(ball, {.modulus = 2e4}, {{.position = Vec3(0, 0, 0.25)}});
  const collision::Touch contact = collision::touch(above, below, 1e-4);
  if (contact.surface.summary.empty()) return 1;
  std::cout << contact.loads[0].force[0].transpose() << " N, within " << 100.0 * contact.surface.summary[0].error_estimate << " %\n";
  return contact.loads[0].force[0].z() > 0.0 ? 0 : 1;
}
