#include "simulation/held_volumes.h"

#include <algorithm>

namespace supple::scenes {
namespace {

std::vector<double> primitive_volumes(const Body& body, const core::ParticleState& particles, double cell) {
  std::vector<Pose> poses;
  for (const implicit::Primitive& primitive : body.skeleton.primitive) {
    const std::uint32_t particle = body.particle[primitive.part];
    poses.push_back({particles.position[particle], particles.orientation[particle]});
  }
  const implicit::Skeleton skeleton = implicit::by_primitive(body.skeleton);
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  implicit::place_skeleton(skeleton, poses, placed);
  implicit::index_field(skeleton, placed, field);
  return implicit::part_volumes(field, cell, poses.size());
}

/// Controlled volumes of a body [m^3]: its own, or those of its particles or primitives. Cells are as fine as the smallest
/// kernels need.
std::vector<double> volumes_of(const StageContext& context, const core::ParticleState& particles, std::size_t body,
                               const std::vector<implicit::VolumeState>& volumes, Frame& frame) {
  const ObjectModel& object = context.model.objects[context.bodies[body].object];
  double scale = implicit::kLargestScale;
  for (std::size_t k = 0; k < object.target.size(); ++k) scale = std::min(scale, volumes[object.first_volume + k].scale);
  const double cell = scale * object.volume_cell;
  if (object.volume_of == VolumeOfName::Primitive) return primitive_volumes(context.bodies[body], particles, cell);
  place_and_index(context, particles, body, frame);
  if (object.volume_of == VolumeOfName::Particle) return implicit::part_volumes(frame.field[body], cell, object.target.size());
  return {implicit::enclosed_volume(frame.field[body], cell)};
}

}  // namespace

void scale_kernels(const Model& model, const std::vector<implicit::VolumeState>& volumes, std::vector<Body>& bodies) {
  for (Body& body : bodies) {
    const ObjectModel& object = model.objects[body.object];
    if (!object.holds_volume) continue;
    const auto at = [](const std::vector<std::uint32_t>& of_object, std::size_t k) { return of_object.empty() ? k : of_object[k]; };
    const auto scale_of = [&](std::size_t primitive) {
      switch (object.volume_of) {
        case VolumeOfName::Object: return volumes[object.first_volume].scale;
        case VolumeOfName::Particle: return volumes[object.first_volume + object.skeleton.primitive[primitive].part].scale;
        case VolumeOfName::Primitive: break;
      }
      return volumes[object.first_volume + primitive].scale;
    };
    for (std::size_t k = 0; k < body.skeleton.primitive.size(); ++k) {
      const std::size_t primitive = at(body.primitive, k);
      implicit::Primitive scaled = implicit::scaled(object.skeleton.primitive[primitive], scale_of(primitive));
      scaled.part = body.skeleton.primitive[k].part;
      body.skeleton.primitive[k] = scaled;
    }
    for (std::size_t k = 0; k < body.samples.size(); ++k) {
      body.samples.reach[k] = scale_of(at(body.primitive, body.samples.primitive[k])) * object.samples.reach[at(body.seed, k)];
    }
  }
}

void measure_targets(const StageContext& context, const core::ParticleState& particles, const std::vector<implicit::VolumeState>& state, Frame& frame,
                     Model& model) {
  for (std::size_t i = 0; i < context.bodies.size(); ++i) {
    ObjectModel& object = model.objects[context.bodies[i].object];
    if (!object.holds_volume || context.bodies[i].origin.is_group()) continue;
    if (std::all_of(object.target.begin(), object.target.end(), [](double v) { return v > 0.0; })) continue;
    const std::vector<double> volumes = volumes_of(context, particles, i, state, frame);
    for (std::size_t k = 0; k < volumes.size(); ++k) {
      if (!(object.target[k] > 0.0)) object.target[k] = volumes[k];
    }
  }
}

bool control_volumes(const StageContext& context, const core::ParticleState& particles, double dt, Frame& frame,
                     std::vector<implicit::VolumeState>& volumes) {
  bool any = false;
  for (std::size_t i = 0; i < context.bodies.size(); ++i) {
    const ObjectModel& object = context.model.objects[context.bodies[i].object];
    if (!object.holds_volume || context.bodies[i].origin.is_group() || rests(context, i)) continue;
    const std::vector<double> found = volumes_of(context, particles, i, volumes, frame);
    for (std::size_t k = 0; k < found.size(); ++k) {
      implicit::VolumeControl control = object.volume;
      control.target = object.target[k];
      if (control.target > 0.0) implicit::control_volume(control, found[k], dt, volumes[object.first_volume + k]);
    }
    any = true;
  }
  return any;
}

}  // namespace supple::scenes
