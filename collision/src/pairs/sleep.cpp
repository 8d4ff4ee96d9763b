#include "supple/collision/sleep.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "supple/core/error.h"

namespace supple::collision {

constexpr double kGivesWay = 0.5;  // share of a load that nothing carries

void SleepState::reset(std::size_t bodies) {
  quiet_for.assign(bodies, 0.0);
  quiet_from.assign(bodies, Vec3::Zero());
  island.assign(bodies, kAwake);
}

bool SleepState::any_asleep() const {
  return std::any_of(island.begin(), island.end(), [](std::uint32_t i) { return i != kAwake; });
}

void SleepState::save(StateWriter& out) const {
  out.write(std::span<const double>(quiet_for));
  out.write(std::span<const Vec3>(quiet_from));
  out.write(std::span<const std::uint32_t>(island));
}

void SleepState::load(StateReader& in) {
  in.read(quiet_for);
  in.read(quiet_from);
  in.read(island);
}

void SleepState::hash(Hasher& hasher) const {
  if (island.empty()) return;
  hasher.add(std::span<const double>(quiet_for));
  hasher.add(std::span<const Vec3>(quiet_from));
  for (const std::uint32_t i : island) hasher.add(std::uint64_t{i});
}

std::vector<std::uint32_t> fall_asleep(const SleepRule& rule, double dt, std::span<const BodyMotion> motion,
                                       std::span<const BodyPair> joined, SleepState& state) {
  const auto count = static_cast<std::uint32_t>(state.island.size());
  SUPPLE_EXPECTS(motion.size() == count && rule.speed > 0.0 && rule.time > 0.0);
  const double time = std::max(rule.time, 2.0 * dt);  // only after a whole step it shows whether the load is carried
  bool any = false;
  for (std::uint32_t i = 0; i < count; ++i) {
    if (state.asleep(i)) continue;
    const BodyMotion& now = motion[i];
    if (!(now.energy < 0.5 * rule.speed * rule.speed)) {
      state.quiet_for[i] = 0.0;
      continue;
    }
    if (state.quiet_for[i] == 0.0) state.quiet_from[i] = now.velocity;
    state.quiet_for[i] = std::min(state.quiet_for[i] + dt, time);
    if (state.quiet_for[i] < time) continue;
    if ((now.velocity - state.quiet_from[i]).dot(now.load) > kGivesWay * now.load.squaredNorm() * (time - dt)) {
      state.quiet_for[i] = 0.0;
    } else {
      any = true;
    }
  }
  if (!any) return {};

  std::vector<std::uint32_t> root(count);
  std::iota(root.begin(), root.end(), 0U);
  const auto find = [&root](std::uint32_t i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  for (const BodyPair& pair : joined) {
    if (pair.a >= count || pair.b >= count) continue;
    const std::uint32_t a = find(pair.a), b = find(pair.b);
    root[std::max(a, b)] = std::min(a, b);  // an island is named by its smallest body
  }
  std::vector<std::uint8_t> restless(count, 0);
  for (std::uint32_t i = 0; i < count; ++i) {
    if (!state.asleep(i) && state.quiet_for[i] < time) restless[find(i)] = 1;
  }
  std::vector<std::uint32_t> slept;
  for (std::uint32_t i = 0; i < count; ++i) {
    if (state.asleep(i) || restless[find(i)] != 0) continue;
    state.island[i] = find(i);
    slept.push_back(i);
  }
  return slept;
}

std::vector<std::uint32_t> wake(std::span<const std::uint32_t> bodies, SleepState& state) {
  std::vector<std::uint8_t> woken(state.island.size(), 0);
  bool any = false;
  for (const std::uint32_t i : bodies) {
    if (!state.asleep(i)) continue;
    woken[state.island[i]] = 1;
    any = true;
  }
  std::vector<std::uint32_t> rose;
  for (std::uint32_t i = 0; any && i < state.island.size(); ++i) {
    if (!state.asleep(i) || woken[state.island[i]] == 0) continue;
    state.island[i] = SleepState::kAwake;
    state.quiet_for[i] = 0.0;
    rose.push_back(i);
  }
  return rose;
}

void BoxTree::build(std::span<const Box> boxes, std::span<const std::uint32_t> which) {
  node_.clear();
  item_.clear();
  for (const std::uint32_t i : which) {
    if (!boxes[i].empty()) item_.push_back(i);
  }
  if (!item_.empty()) add_node(boxes, 0, static_cast<std::uint32_t>(item_.size()));
  box_.clear();
  for (const std::uint32_t i : item_) box_.push_back(boxes[i]);
}

std::uint32_t BoxTree::add_node(std::span<const Box> boxes, std::uint32_t first, std::uint32_t last) {
  constexpr std::uint32_t kLeaf = 4;
  const auto index = static_cast<std::uint32_t>(node_.size());
  Node node{.box = {}, .first = first, .last = last};
  Box centres;
  for (std::uint32_t k = first; k < last; ++k) {
    node.box = node.box.united(boxes[item_[k]]);
    centres.include(boxes[item_[k]].centre());
  }
  node_.push_back(node);
  if (last - first <= kLeaf) return index;
  Eigen::Index axis = 0;
  centres.extent().maxCoeff(&axis);
  const std::uint32_t middle = first + (last - first) / 2;
  std::nth_element(item_.begin() + first, item_.begin() + middle, item_.begin() + last, [&](std::uint32_t i, std::uint32_t j) {
    const double x = boxes[i].centre()[axis], y = boxes[j].centre()[axis];
    return x != y ? x < y : i < j;
  });
  add_node(boxes, first, middle);
  node_[index].right = add_node(boxes, middle, last);
  return index;
}

void BoxTree::find(const Box& box, std::vector<std::uint32_t>& out) const {
  if (node_.empty() || box.empty()) return;
  std::array<std::uint32_t, 64> open;  // halves of halves: deeper than any tree of 2^32 items
  std::size_t count = 0;
  open[count++] = 0;
  while (count > 0) {
    const std::uint32_t index = open[--count];
    const Node& node = node_[index];
    if (!node.box.overlaps(box)) continue;
    if (node.right == 0) {
      for (std::uint32_t k = node.first; k < node.last; ++k) {
        if (box_[k].overlaps(box)) out.push_back(item_[k]);
      }
      continue;
    }
    open[count++] = node.right;
    open[count++] = index + 1;
  }
}

}  // namespace supple::collision
