#include "model/divide.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "file/scene_places.h"

namespace supple::scenes {
namespace {

/// Bodies that never touch may overlap, and do not divide space there.
void find_excluded(const Model& model, const std::vector<Body>& bodies, Division& division) {
  std::vector<std::vector<std::size_t>> excluded(division.body.size());
  bool any = false;
  for (std::size_t k = 0; k < excluded.size(); ++k) {
    const std::uint32_t a = bodies[division.body[k]].object;
    for (std::size_t j = k + 1; j < excluded.size(); ++j) {
      const std::uint32_t b = bodies[division.body[j]].object;
      if (a == b || may_touch(model, a, b) || !division.pressure[k].surface_box().overlaps(division.pressure[j].surface_box())) continue;
      excluded[k].push_back(j);
      excluded[j].push_back(k);
      any = true;
    }
  }
  if (any) division.excluded = std::move(excluded);
}

}  // namespace

Division division_of(const Model& model, const std::vector<Body>& bodies, std::span<const implicit::Field> fields,
                     std::span<const collision::ContactBody> placed, const collision::ContactSurface& surface, const Executor& executor) {
  Division out;
  const std::size_t surfaces = surface_count(bodies);  // groups divide none: where they meet, their component has a crease
  for (const auto& s : surface.summary) {
    for (const std::uint32_t body : {s.bodies.a, s.bodies.b}) {
      if (body < surfaces) out.body.push_back(body);
    }
    if (s.bodies.b < surfaces) out.pair.push_back(s.bodies);
  }
  out.placed.assign(placed.begin(), placed.end());
  for (std::uint32_t i = 0; i < surfaces; ++i) {
    if (bodies[i].skeleton.primitive.empty()) continue;
    if (out.placed[i].pose.empty()) out.placed[i].field = fields[i];
    for (std::uint32_t j = i + 1; j < surfaces && bodies[j].object == bodies[i].object; ++j) {
      if (bodies[j].skeleton.primitive.empty()) continue;
      if (!fields[i].surface_box().overlaps(fields[j].surface_box())) continue;
      out.body.insert(out.body.end(), {i, j});
      out.pair.push_back({i, j});
    }
  }
  std::sort(out.body.begin(), out.body.end());
  out.body.erase(std::unique(out.body.begin(), out.body.end()), out.body.end());
  std::vector<std::optional<collision::DeformedPressure>> pressure(out.body.size());
  executor.for_blocks(pressure.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) pressure[k].emplace(out.placed, out.body[k], surface, model.bulge);
  });
  out.pressure.reserve(pressure.size());
  for (auto& c : pressure) out.pressure.push_back(std::move(*c));
  if (model.rules.allowed || !model.closed.empty()) find_excluded(model, bodies, out);
  return out;
}

std::map<std::string, std::map<std::string, ShortBulges>> find_short_bulges(const Model& model, const std::vector<Body>& bodies, const Division& division,
                                                                            double time) {
  const auto object = [&](std::uint32_t body) -> const std::string& { return object_name(model, bodies, body); };
  std::map<std::string, std::map<std::string, ShortBulges>> found;
  for (std::size_t k = 0; k < division.body.size(); ++k) {
    for (const collision::BulgeVolume& bulge : division.pressure[k].volumes()) {
      if (!bulge.falls_short()) continue;
      found[object(division.body[k])][object(bulge.other)].add({.count = 1, .held = bulge.held / bulge.displaced, .time = time});
    }
  }
  return found;
}

std::vector<std::size_t> Division::others_of(std::size_t k) const {
  std::vector<std::size_t> others;
  for (std::size_t j = 0; j < pressure.size(); ++j) {
    if (j == k || !pressure[j].surface_box().overlaps(pressure[k].surface_box())) continue;
    if (excluded.empty() || !std::binary_search(excluded[k].begin(), excluded[k].end(), j)) others.push_back(j);
  }
  return others;
}

}  // namespace supple::scenes
