#include "simulation/reach.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <variant>

#include "supple/implicit/skeleton.h"
#include "supple/implicit/volume.h"

namespace supple::scenes {
namespace {

constexpr std::size_t kMostBoxes = 32;         // of an object
constexpr int kMostHalvings = 8;                 // of a box that bounds of F are taken on
constexpr std::size_t kMostBoxesOfAll = 1024;  // of all objects, at least one of each
constexpr std::size_t kMostTests = 4096;       // pairs of an object and a solid that are looked at in every frame

/// Largest distance of the support of a primitive from its origin, or more [m].
double furthest(const implicit::Primitive& p) {
  constexpr double kRoundOff = 1.0 + 1e-12;
  const Box box = implicit::support_box(p);
  const Vec3 corner = box.lower.cwiseAbs().cwiseMax(box.upper.cwiseAbs());
  if (implicit::scales(p) || p.taper != 1.0 || p.stretch != Vec3::Ones()) return kRoundOff * corner.norm();
  const double radius = p.kernel.radius;  // the support is what is nearer to the shape
  return kRoundOff * ((corner.array() - radius).max(0.0).matrix().norm() + radius);
}

/// Distance from each particle of an object that its primitives reach at most, in any orientation [m].
std::vector<double> reach_of_particles(const ObjectModel& object) {
  std::vector<double> reach(object.last - object.first, 0.0);
  const double scale = object.holds_volume ? implicit::kLargestScale : 1.0;
  for (const implicit::Primitive& p : object.skeleton.primitive) {
    const double radius = furthest(p);
    reach[p.part] = std::max(reach[p.part], p.offset.position.norm() + scale * radius);
  }
  return reach;
}

Box box_of(const ObjectModel& object, const core::ParticleState& particles) {
  const std::vector<double> reach = reach_of_particles(object);
  Box box;
  for (std::size_t k = 0; k < reach.size(); ++k) {
    const Vec3& x = particles.position[object.first + k];
    if (reach[k] > 0.0) box = box.united(Box{x, x}.inflated(reach[k]));
  }
  return box;
}

/// The number of the box of the present frame; neighbours in time are united where there are too many.
std::size_t place_in_time(const State& state, std::size_t objects, RunRecord& record) {
  const std::size_t most = std::clamp<std::size_t>(kMostBoxesOfAll / std::max<std::size_t>(1, objects), 1, kMostBoxes);
  const auto frame = static_cast<std::uint64_t>(std::max(1, state.frame) - 1);
  while (frame / record.reach_frames >= most) {
    for (std::vector<Box>& boxes : record.reach) {
      for (std::size_t k = 0; 2 * k < boxes.size(); ++k) {
        boxes[k] = 2 * k + 1 < boxes.size() ? boxes[2 * k].united(boxes[2 * k + 1]) : boxes[2 * k];
      }
      boxes.resize((boxes.size() + 1) / 2);
    }
    record.reach_frames *= 2;
  }
  return static_cast<std::size_t>(frame / record.reach_frames);
}

/// Whether F <= 0 on a box: by bounds on the box, or on both halves of it, and so on.
bool is_outside(const implicit::FieldView& field, const Box& box, int halvings) {
  if (!box.overlaps(field.surface_box()) || field.bound(box).upper <= 0.0) return true;
  if (halvings == 0) return false;
  Eigen::Index axis = 0;
  box.extent().maxCoeff(&axis);
  Box low = box, high = box;
  low.upper[axis] = high.lower[axis] = box.centre()[axis];
  return is_outside(field, low, halvings - 1) && is_outside(field, high, halvings - 1);
}

/// Numbers of solids before and now. @return none for one that is not there now
std::vector<std::optional<std::uint32_t>> numbers_now(const std::vector<RunRecord::Solid>& before, const std::vector<RunRecord::Solid>& now) {
  std::vector<std::optional<std::uint32_t>> number;
  for (const RunRecord::Solid& solid : before) {
    const auto at = std::find_if(now.begin(), now.end(), [&](const RunRecord::Solid& other) { return other.name == solid.name; });
    number.push_back(at == now.end() ? std::nullopt : std::optional(static_cast<std::uint32_t>(at - now.begin())));
  }
  return number;
}

}  // namespace

bool takes_part(const FixedBody& solid) { return solid.led() || std::holds_alternative<FixedBody::Primitives>(solid.solid); }

bool is_apart(const FixedBody& solid, const Box& box) {
  if (box.empty()) return true;
  return !takes_part(solid) && is_outside(solid.field(), box, kMostHalvings);
}

double largest_difference(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double squared = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) squared = std::max(squared, (a[i] - b[i]).squaredNorm());
  return std::sqrt(squared);
}

void book_reach(const Model& model, const State& state, double way, RunRecord& record) {
  const std::size_t objects = model.objects.size(), tests = objects * model.fixed.size();
  if (record.reach.size() != objects || record.solids.size() != model.fixed.size()) {
    record.reach.assign(objects, {});
    record.reach_frames = 1;
    record.solids.clear();
    for (const FixedBody& solid : model.fixed) record.solids.push_back({solid.name, tests > kMostTests || takes_part(solid)});
  }
  const std::size_t place = place_in_time(state, objects, record);
  for (std::uint32_t i = 0; i < objects; ++i) {
    const ObjectModel& object = model.objects[i];
    record.reach[i].resize(std::max(record.reach[i].size(), place + 1));
    if (!object.collides) continue;
    record.reach[i][place] = record.reach[i][place].united(box_of(object, state.particles).inflated(way));
  }
}

void look_for_solids(const Model& model, RunRecord& record) {
  const auto objects = static_cast<std::uint32_t>(model.objects.size());
  for (std::uint32_t k = 0; k < model.fixed.size(); ++k) {
    RunRecord::Solid& solid = record.solids[k];
    for (std::uint32_t i = 0; i < objects && !solid.reached; ++i) {
      if (!model.objects[i].collides || (model.rules.allowed && !model.rules.allowed(i, objects + k))) continue;
      solid.reached = !is_apart(model.fixed[k], record.reach[i].back());
    }
  }
}

void renumber_solids(const Model& model, State& state) {
  const std::vector<RunRecord::Solid> before = std::move(state.record.solids);
  const auto named = [](const FixedBody& body) { return [&](const RunRecord::Solid& solid) { return solid.name == body.name; }; };
  std::vector<RunRecord::Solid>& solids = state.record.solids = {};
  for (const FixedBody& body : model.fixed) {
    const auto at = std::find_if(before.begin(), before.end(), named(body));
    solids.push_back(at == before.end() ? RunRecord::Solid{body.name, false} : *at);
  }
  const auto same = [](const RunRecord::Solid& one, const RunRecord::Solid& other) { return one.name == other.name; };
  if (before.empty() || std::equal(before.begin(), before.end(), solids.begin(), solids.end(), same)) return;
  const std::vector<std::optional<std::uint32_t>> now = numbers_now(before, solids);
  const auto moved = [&](std::uint32_t& number, std::size_t first) {
    if (number < first) return true;
    const std::size_t k = number - first;
    if (k >= now.size() || !now[k]) return false;
    number = static_cast<std::uint32_t>(first) + *now[k];
    return true;
  };
  const auto all_moved = [&](collision::BodyPair& pair, std::size_t first) { return moved(pair.a, first) && moved(pair.b, first); };
  const std::size_t bodies = state.samples.size(), objects = state.record.reach.size();
  std::erase_if(state.sticks.spring, [&](auto& spring) { return !all_moved(spring.pair, bodies); });
  std::erase_if(state.record.pair_work, [&](auto& pair) { return !all_moved(pair.bodies, bodies); });
  std::erase_if(state.record.pair_contacts, [&](auto& pair) { return !all_moved(pair.objects, objects); });
}

}  // namespace supple::scenes
