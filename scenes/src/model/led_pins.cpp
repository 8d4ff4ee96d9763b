#include "model/led_pins.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "file/expand/course.h"
#include "supple/scenes/solid_motion.h"

namespace supple::scenes {
namespace {

/// Of the particle's place at the start.
using Ways = std::array<std::shared_ptr<const core::Course>, 3>;

SolidMotion keyed(const PinMotionDesc& d) {
  SolidMotion motion{.keys = {}, .between = d.between, .axis = d.turn_axis.normalized()};
  if (d.keys.front().time > 0.0) motion.keys.push_back({});
  for (const PinKeyDesc& key : d.keys) motion.keys.push_back({.time = key.time, .at = key.by, .turn = key.turn});
  return motion;
}

double speed_of(const core::Course& way) {
  double speed = 0.0;
  for (std::size_t k = 1; k < way.time.size(); ++k) speed = std::max(speed, std::abs(way.factor[k] - way.factor[k - 1]) / (way.time[k] - way.time[k - 1]));
  return speed;
}

Vec3 along(const Ways& ways, double time) {
  Vec3 by = Vec3::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    if (ways[static_cast<std::size_t>(axis)]) by[axis] = ways[static_cast<std::size_t>(axis)]->at(time);
  }
  return by;
}

bool leaves_plane(const PinMotionDesc& d) {
  const bool tilts = d.turn_axis.head<2>() != Vec3::Zero().head<2>();
  return !d.z.empty() || std::any_of(d.keys.begin(), d.keys.end(), [&](const PinKeyDesc& key) { return key.by.z() != 0.0 || (tilts && key.turn != 0.0); });
}

}  // namespace

void add_led_pin(const Scene& scene, const PinDesc& d, const std::string& key, core::LedPin pin, Model& model, ModelFaults& faults) {
  const PinMotionDesc& motion = *d.motion;
  if (scene.planar && leaves_plane(motion)) {
    faults.add(key + ".motion", "expected a motion in the plane of a planar scene", "one that leaves it", "");
    return;
  }
  const Pose start{model.initial.position[pin.particle], model.initial.orientation[pin.particle]};
  if (!motion.keys.empty()) {
    SolidMotion way = keyed(motion);
    model.solid_speed = std::max(model.solid_speed, largest_speed(way, 0.0));
    pin.place = [start, way = std::move(way)](double time) {
      const Pose at = place_at(way, time).pose;
      return Pose{start.position + at.position, (at.orientation * start.orientation).normalized()};
    };
  } else {
    Ways ways;
    double speed2 = 0.0;
    const std::array<const std::string*, 3> expressions{&motion.x, &motion.y, &motion.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      try {
        ways[axis] = way_of(*expressions[axis], scene);
      } catch (const ExpressionFault& fault) {
        faults.add(key + ".motion." + "xyz"[axis], fault.expected, fault.found, fault.hint);
        return;
      }
      if (ways[axis]) speed2 += speed_of(*ways[axis]) * speed_of(*ways[axis]);
    }
    model.solid_speed = std::max(model.solid_speed, std::sqrt(speed2));
    pin.place = [start, ways](double time) { return Pose{start.position + along(ways, time), start.orientation}; };
  }
  model.led.push_back(std::move(pin));
}

void sort_led_pins(const Scene& scene, Model& model, ModelFaults& faults) {
  std::stable_sort(model.led.begin(), model.led.end(), [](const core::LedPin& a, const core::LedPin& b) { return a.particle < b.particle; });
  const auto twice = std::adjacent_find(model.led.begin(), model.led.end(), [](const core::LedPin& a, const core::LedPin& b) { return a.particle == b.particle; });
  if (twice == model.led.end()) return;
  const std::uint32_t object = model.particles.object[twice->particle];
  faults.add("objects." + scene.objects[object].name + ".pins", "expected at most one pin with a motion for a particle",
             "two for particle " + std::to_string(twice->particle - model.objects[object].first), "");
}

bool leads(const core::LedPin& pin, double from, double to) {
  const Pose a = pin.place(from), b = pin.place(to);
  return a.position != b.position || a.orientation.coeffs() != b.orientation.coeffs();
}

}  // namespace supple::scenes
