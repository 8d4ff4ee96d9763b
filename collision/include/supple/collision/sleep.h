/// @file supple/collision/sleep.h
/// Bodies that rest need not be moved. A body is quiet while its kinetic energy over its mass is below speed^2 / 2; it rests
/// when it has been quiet for long enough, two steps at least, and something carried its load meanwhile. What touches,
/// directly or through others, is an island. An island all of whose bodies rest falls asleep, and wakes as a whole when one of
/// them is woken. Solids that stand still join nothing.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/collision/bodies.h"
#include "supple/core/hash.h"

namespace supple::collision {

struct SleepRule {
  double speed = 0.01;  ///< [m/s], > 0
  double time = 0.5;    ///< [s], > 0
};

/// By body; both empty: nothing ever sleeps. Part of State.
struct SleepState {
  static constexpr std::uint32_t kAwake = 0xffffffff;
  std::vector<double> quiet_for;      ///< how long the body has been quiet [s], up to the rule's time; shape [bodies]
  std::vector<Vec3> quiet_from;       ///< its velocity when that began [m/s]; shape [bodies]
  std::vector<std::uint32_t> island;  ///< smallest body of those that it fell asleep with, or kAwake; shape [bodies]

  void reset(std::size_t bodies);     ///< all awake
  [[nodiscard]] bool asleep(std::size_t body) const { return body < island.size() && island[body] != kAwake; }
  [[nodiscard]] bool any_asleep() const;
  void save(StateWriter& out) const;
  void load(StateReader& in);
  void hash(Hasher& hasher) const;
};

/// What a body does at the end of a step, all over its mass.
struct BodyMotion {
  double energy = 0.0;            ///< kinetic [J/kg]
  Vec3 velocity = Vec3::Zero();   ///< of its centre [m/s]
  Vec3 load = Vec3::Zero();       ///< gravity and other loads from outside [m/s^2]
};

/// At the end of a step of `dt` [s]: bodies that are awake grow quieter, and islands that rest fall asleep. A body that gave way
/// to more than half of its load while it was quiet, v - v_then > load time / 2 along the load, falls and begins anew.
/// @param motion  of bodies that are awake, shape [bodies]
/// @param joined  bodies that touch or act on each other; pairs with a number beyond the bodies (fixed ones) count not
/// @return bodies that fell asleep, ascending
std::vector<std::uint32_t> fall_asleep(const SleepRule& rule, double dt, std::span<const BodyMotion> motion,
                                       std::span<const BodyPair> joined, SleepState& state);

/// Wakes whole islands. @return bodies that were asleep, ascending
std::vector<std::uint32_t> wake(std::span<const std::uint32_t> bodies, SleepState& state);

/// Boxes that stay where they are, in a binary tree: what overlaps a box is found in the time of its depth.
class BoxTree {
 public:
  /// @param which  boxes to hold, by index; empty boxes are left out
  void build(std::span<const Box> boxes, std::span<const std::uint32_t> which);
  /// Appends the indices of boxes that overlap `box`, in no special order.
  void find(const Box& box, std::vector<std::uint32_t>& out) const;

 private:
  struct Node {
    Box box;
    std::uint32_t first = 0, last = 0;  ///< of `item_`
    std::uint32_t right = 0;            ///< the second child; the first one follows its parent. 0: a leaf
  };
  std::uint32_t add_node(std::span<const Box> boxes, std::uint32_t first, std::uint32_t last);

  std::vector<Node> node_;
  std::vector<std::uint32_t> item_;
  std::vector<Box> box_;  // of the items
};

}  // namespace supple::collision
