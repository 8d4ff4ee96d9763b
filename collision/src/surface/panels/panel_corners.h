/// @file panel_corners.h
/// Corners of a patch within a panel: where its parallel lines begin or cease to meet the patch, or meet other levels. What lines say is smooth in between.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace supple::collision {

/// Where a line enters or leaves the patch.
struct LineEnd {
  static constexpr std::uint16_t kSide = 0xffff;
  std::uint16_t level;  ///< that changes its sign there; kSide: the panel ends
  double place;         ///< along the line [m]
  double drift;         ///< of the place from line to line, over the distance between them [1]
};

/// The piece of a line that the patch has, between two levels; of a line that misses the patch, the place where it comes nearest to having one: two levels are
/// negative there alone, the one before and the other one beyond.
struct LineSlot {
  std::uint16_t enters, leaves;  ///< levels
  double length;                 ///< negative: by how much it misses [m]
  double drift;                  ///< of the length, from line to line
};

/// A line of a panel.
struct LineShape {
  double at;                      ///< its coordinate across the lines [m]
  double area = 0.0, load = 0.0;  ///< of the strip around it over the strip's width [m], [N/m]
  std::span<const LineEnd> ends;  ///< by rising places: enters, leaves, enters, ...
  std::optional<LineSlot> missed{};  ///< of a line without ends
};

/// What may be wrong between two lines that are not cut alike.
struct PanelCorner {
  double at;          ///< where the lines change, as the ends of these two drift [m]
  double area, load;  ///< what a straight line between the sums of both may be off by where these bend once: an eighth of the rectangle
};

/// The same between the outermost line and the side of the panel beside it, at `side`: where its ends meet before, what goes on as before would be wrong by
/// what they drift from there on.
[[nodiscard]] std::optional<PanelCorner> corner_beyond(const LineShape& last, double side, double low, double high);

/// @return none where the lines are cut alike
[[nodiscard]] std::optional<PanelCorner> corner_between(const LineShape& one, const LineShape& other, double low, double high);

}  // namespace supple::collision
