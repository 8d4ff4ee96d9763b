/// @file triangle_steps.h
/// A mesh whose triangles are replaced a few at a time, by steps that can be taken back.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace supple::implicit {

/// All triangles that there ever were keep their numbers, those of the mesh to begin with come first.
class TriangleSteps {
 public:
  using Triangle = std::array<std::uint32_t, 3>;
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  explicit TriangleSteps(std::vector<Triangle> mesh) : triangle_(std::move(mesh)), first_made_(triangle_.size()), taker_(triangle_.size(), kNone) {}

  /// A step: replaces triangles by others with the same border. @return number of the first of these
  std::uint32_t replace(std::span<const std::uint32_t> taken, std::span<const Triangle> made);
  /// Undoes a step, and before it those that replaced what it made. @param back  what is there again is appended
  void take_back(std::uint32_t step, std::vector<std::uint32_t>& back);

  [[nodiscard]] std::span<const Triangle> triangles() const { return triangle_; }
  [[nodiscard]] const Triangle& operator[](std::uint32_t number) const { return triangle_[number]; }
  [[nodiscard]] bool is_there(std::uint32_t number) const { return taker_[number] == kNone; }
  /// The step that made a triangle, later ones with larger numbers; kNone for those of the mesh to begin with.
  [[nodiscard]] std::uint32_t maker(std::uint32_t number) const { return number < first_made_ ? kNone : maker_[number - first_made_]; }
  /// Numbers of the triangles that are there.
  [[nodiscard]] std::vector<std::uint32_t> numbers() const;

 private:
  static constexpr std::uint32_t kUndone = kNone - 1;  ///< in place of a taker: the step that made it was taken back
  struct Step {
    std::uint32_t made, made_end, taken, taken_end;  ///< triangles, and places in taken_
  };

  std::vector<Triangle> triangle_;
  std::size_t first_made_;
  std::vector<std::uint32_t> taker_;  ///< the step that replaced a triangle, or kNone, or kUndone
  std::vector<std::uint32_t> maker_;  ///< of those from first_made_ on
  std::vector<std::uint32_t> taken_;
  std::vector<Step> step_;
};

}  // namespace supple::implicit
