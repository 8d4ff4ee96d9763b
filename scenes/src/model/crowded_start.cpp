#include "model/crowded_start.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "file/fields/fields_particles.h"
#include "model/arrangement.h"
#include "supple/core/arrange.h"

namespace supple::scenes {
namespace {

/// Equal balls that touch have twelve neighbours at most; pairs times neighbours take about a tenth of a millisecond each.
constexpr double kOrdinary = 16.0, kMostCuts = 5000.0;

/// Below this distance surfaces of the object's bodies overlap: surfaces of the usual kernels reach at least half as far as the support.
double reach_of(const ObjectDesc& d) {
  double reach = std::numeric_limits<double>::infinity();
  for (const SkeletonDesc& s : d.skeleton) reach = std::min(reach, s.kernel.radius);
  return d.skeleton.empty() ? 0.0 : reach;
}

}  // namespace

std::optional<CrowdedStart> find_crowd(const Scene& scene) {
  std::vector<Vec3> all;
  double reach = std::numeric_limits<double>::infinity();
  std::size_t most = 0;
  CrowdedStart crowd;
  for (const ObjectDesc& d : scene.objects) {
    if (!d.contact || d.skeleton.empty() || (!d.separate && particle_count(d.particles).value_or(1) > 1)) continue;
    ModelFaults unused(scene);
    const std::vector<Vec3> own = arrange(scene, d.particles, "objects." + d.name + ".particles", unused).position;
    if (own.empty() || (!d.separate && own.size() > 1)) continue;
    all.insert(all.end(), own.begin(), own.end());
    reach = std::min(reach, reach_of(d));
    if (own.size() <= most) continue;
    most = own.size();
    crowd.key = "objects." + d.name + ".particles";
  }
  if (all.empty() || !(reach > 0.0)) return std::nullopt;
  crowd.pairs = static_cast<double>(core::count_bonds_within(all, reach).number);
  crowd.others = 2.0 * crowd.pairs / static_cast<double>(all.size());
  if (!(crowd.others > kOrdinary && crowd.pairs * crowd.others > kMostCuts)) return std::nullopt;
  return crowd;
}

}  // namespace supple::scenes
