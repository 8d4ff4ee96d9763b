#include "file/expand/scale_object.h"

namespace supple::scenes {
namespace {

void scale(std::optional<double>& length, double by) {
  if (length) *length *= by;
}

void scale(ParticlesDesc& d, double by) {
  for (double* length : {&d.radius, &d.inner_radius, &d.outer_radius, &d.spacing, &d.disorder, &d.length, &d.thickness}) *length *= by;
  for (Vec3& p : d.points) p *= by;
  for (double& area : d.sections) area *= by * by;
  for (double& curvature : d.curvatures) curvature /= by;
  d.size *= by;
  d.inertia_axes *= by;
  scale(d.inertia_radius, by);
}

void scale(SkeletonDesc& d, double by) {
  for (double* length : {&d.half_size, &d.half_length, &d.radius, &d.end_radius, &d.kernel.radius}) *length *= by;
  for (Vec3* lengths : {&d.half_sizes, &d.semi_axes, &d.radii, &d.radii_behind, &d.at}) *lengths *= by;
  for (Vec3& p : d.points) p *= by;
  scale(d.kernel.thickness, by);
  if (d.kernel.slope) *d.kernel.slope /= by;
  if (d.volume) *d.volume *= by * by * by;
}

}  // namespace

void scale_lengths(ObjectDesc& d) {
  if (d.scale == 1.0) return;
  scale(d.particles, d.scale);
  for (SkeletonDesc& primitive : d.skeleton) scale(primitive, d.scale);
  for (InteractionDesc& law : d.interactions) scale(law.within, d.scale);
  if (d.blend) scale(d.blend->within, d.scale);
  scale(d.meshing.cell, d.scale);
  scale(d.meshing.error, d.scale);
}

}  // namespace supple::scenes
