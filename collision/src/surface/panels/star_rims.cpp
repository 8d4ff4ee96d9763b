/// Where the lines of a star leave its patch, and what third bodies take of them before.
#include <algorithm>
#include <cmath>
#include <utility>

#include "surface/panels/panel_pass.h"

namespace supple::collision::panel_pass {

/// A level of a panel where a line of a star leaves the patch.
std::optional<LevelSample> Pass::at_rim(std::uint32_t index, std::size_t level) const {
  if (index >= a_.rim.size() || !a_.rim[index].found || level == 0) return std::nullopt;
  const PanelArena::RimEnd& rim = a_.rim[index];
  const LevelValue& value = a_.rim_value[rim.values.begin + level - 1];
  const std::size_t inner = panels_[a_.line[index].panel].inner;
  return LevelSample{a_.rim_ray[rim.ray].place[inner], value.value, value.slope[inner]};
}

/// Where lines of a star leave the patch, and the other levels there: between them and the middle alone these matter.
void Pass::meet_rims() {
  std::vector<LevelValue> lattice = std::move(a_.value);
  search();
  a_.rim.assign(a_.line.size(), {});
  a_.rim_ray.clear();
  a_.query.clear();
  for (std::size_t i = 0; i < a_.search.size(); ++i) {
    const PanelArena::Search& search = a_.search[i];
    PanelArena::RimEnd& rim = a_.rim[search.line];
    if (rim.found || !search.found || search.root.rises) continue;
    const Panel& panel = panels_[a_.line[search.line].panel];
    rim.found = true;
    rim.drift = search.drift;
    rim.ray = static_cast<std::uint32_t>(a_.rim_ray.size());
    SigmaRay ray = a_.cut_ray[i];
    const PlaneChart::Place from = ray.at;
    ray.place[panel.inner] = search.place;
    ray.at = s_.chart.at(ray.place);
    ray.height += (ray.at[0] - from[0]) * ray.rise[0] + (ray.at[1] - from[1]) * ray.rise[1];
    ray.pressure += (ray.at[0] - from[0]) * ray.slope[0] + (ray.at[1] - from[1]) * ray.slope[1];
    a_.rim_ray.push_back(ray);
    rim.values.begin = static_cast<std::uint32_t>(a_.query.size());
    for (std::uint32_t l = panel.levels.begin + 1; l < panel.levels.end; ++l) a_.query.push_back({rim.ray, a_.level[l], {}});
    rim.values.end = static_cast<std::uint32_t>(a_.query.size());
  }
  a_.rim_search.swap(a_.search);
  a_.search.clear();
  evaluate(a_.rim_ray);
  a_.rim_value = std::move(a_.value);
  a_.value = std::move(lattice);
  for (std::uint32_t i = 0; i < a_.line.size(); ++i) look_at_rim(i);
}

/// By how much a line misses the patch that a third body takes from it up to the rim.
void Pass::look_at_rim(std::uint32_t index) {
  PanelArena::RimEnd& rim = a_.rim[index];
  const Panel& panel = panels_[a_.line[index].panel];
  if (!rim.found) return;
  for (std::size_t l = 1; l < panel.levels.size(); ++l) {
    const std::uint16_t level = a_.level[panel.levels.begin + l];
    const LevelValue& value = a_.rim_value[rim.values.begin + l - 1];
    const double steep = value.slope[panel.inner];
    if (!s_.levels.is_third(level) || value.value > 0.0 || !(steep > 0.0)) continue;
    const double length = value.value / steep;
    if (rim.taken && length >= rim.missed.length) continue;
    rim.taken = true;
    rim.missed = {level, Levels::kRim, length, (value.slope[1 - panel.inner] + rim.drift * steep) / steep};
  }
}

/// The rims of a star's lines, before the other searches of each.
void Pass::join_rims() {
  a_.search.insert(a_.search.end(), a_.rim_search.begin(), a_.rim_search.end());
  std::erase_if(a_.search, [this](const PanelArena::Search& search) { return a_.line[search.line].dead; });
  std::stable_sort(a_.search.begin(), a_.search.end(), [](const PanelArena::Search& p, const PanelArena::Search& q) { return p.line != q.line ? p.line < q.line : p.level < q.level; });
}

}  // namespace supple::collision::panel_pass
