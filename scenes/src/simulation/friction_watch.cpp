#include "simulation/friction_watch.h"

#include <algorithm>

namespace supple::scenes {

void FrictionWatch::look(const StageContext& context, const Frame& frame) {
  for (std::size_t k = 0; k < std::min(frame.friction_speed.size(), frame.surface.summary.size()); ++k) {
    const auto& s = frame.surface.summary[k];
    if (!(s.load > 0.0) || !(frame.friction_speed[k] > 0.0)) continue;
    auto names = std::minmax(object_name(context.model, context.bodies, s.bodies.a), object_name(context.model, context.bodies, s.bodies.b));
    double& known = speeds_[{names.first, names.second}];
    known = std::max(known, frame.friction_speed[k]);
  }
}

}  // namespace supple::scenes
