#include "supple/scenes/contact_report.h"

#include "simulation/contact_work.h"

namespace supple::scenes {

ContactReport report_contacts(Simulation& simulation) {
  ContactReport report{.pairs = {},
                       .points = simulation.contacts(),
                       .loads = simulation.contact_loads(),
                       .dissipated_work = all_pair_work(simulation.state().record)};
  std::size_t point = 0;
  for (std::uint32_t k = 0; k < report.points.summary.size(); ++k) {
    const collision::ContactSurface::Summary& s = report.points.summary[k];
    const std::size_t first = point;
    while (point < report.points.pair.size() && report.points.pair[point] == k) ++point;
    report.pairs.push_back({.a = body_name(simulation.model(), simulation.bodies(), s.bodies.a),
                            .b = body_name(simulation.model(), simulation.bodies(), s.bodies.b),
                            .bodies = s.bodies,
                            .force = simulation.contact_forces()[k],
                            .elastic_force = s.force,
                            .centre_of_pressure = s.centre_of_pressure,
                            .area = s.area,
                            .largest_pressure = s.largest_pressure,
                            .largest_overlap = s.largest_overlap,
                            .energy = s.energy,
                            .dissipated_power = simulation.contact_powers()[k],
                            .dissipated_work = pair_work(simulation.state().record, s.bodies),
                            .error_estimate = s.error_estimate,
                            .rule = s.rule,
                            .first = first,
                            .last = point});
    report.energy += s.energy;
    report.dissipated_power += report.pairs.back().dissipated_power;
  }
  return report;
}

const char* rule_name(collision::ContactRule rule) {
  switch (rule) {
    case collision::ContactRule::Polar: return "polar";
    case collision::ContactRule::March: return "march";
    case collision::ContactRule::Panels: return "panels";
    case collision::ContactRule::None: break;
  }
  return "none";
}

}  // namespace supple::scenes
