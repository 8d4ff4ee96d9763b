/// @file panels.h
/// Quadrature on Sigma over panels: rectangles across parallel rays, cut along lines where level functions change their sign (nested reduction of
/// dimensions: Saye 2015, SIAM J. Sci. Comput. 37, A993).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "surface/panels/level_roots.h"
#include "surface/panels/panel_corners.h"
#include "surface/panels/panel_levels.h"
#include "surface/panels/plane_chart.h"
#include "surface/panels/sigma_rays.h"
#include "surface/patch_points.h"
#include "surface/polar/apex.h"

namespace supple::collision {

/// Least cosine between Sigma's normal and the rays that see it: panels whose rays are nearer to grazing are parted.
inline constexpr double kRayCosine = 0.3;

/// Points of a larger array.
struct Slice {
  std::uint32_t begin = 0, end = 0;
  [[nodiscard]] std::size_t size() const { return end - begin; }
};

/// A box in the frame of the rays. Its panel is the rectangle across the axis along which Sigma is seen; of a star, in its coordinates (PlaneChart).
struct Panel {
  std::array<double, 3> low{}, high{};  // [m]; of a star the angle [rad], the share of its reach, and the height [m]
  std::uint8_t along = 2;               // the axis of its rays
  bool reverse = false;                 // which leads out of B into A
  bool walls = false;                   // Sigma counts only between its heights; else it is all there is along the rays
  bool cut = false;                     // lines are parted at kinks
  std::uint8_t inner = 0;               // along which coordinate of the plane lines run
  std::uint8_t depth = 0;
  std::uint64_t thirds = 0;             // by bits, which third bodies press as hard somewhere; the last bit is that of all from there on
  bool steep = false;                   // Sigma is no graph, or may be more than one sheet
  bool open = false;                    // of a star: the patch reaches beyond it
  Slice levels, guess, nodes, points;   // level numbers; rays to start from; its own; points of its sums
  PatchSums sums, off;                  // by the order asked for; less those by the order below
  double missed_load = 0.0, missed_area = 0.0;  // what it may hold beside its nodes
  std::uint8_t parting = 0;             // the coordinate of the plane that it would be split at
  double parting_place = 0.0;           // and where [m]
};

/// A place of Sigma with its area.
struct PanelPoint {
  Vec3 at, normal;
  double area, pressure, mismatch;
  std::array<double, 2> fall;  // of the pressures along the ray [Pa/m]
  double cosine;
};

[[nodiscard]] constexpr std::uint64_t third_bit(std::size_t third) { return std::uint64_t{1} << (third < 63 ? third : 63); }

/// What all panels of a pair share.
struct PanelSetting {
  SigmaView view;
  Levels levels;
  PlaneChart chart{};
  std::array<std::optional<Apex>, 2> apex{};  // that the columns of A, of B come out of
  int order = 3;          // Gauss points along a line, and lines
  double enough = 0.0;    // of a step towards Sigma [m]
  double enough_rim = 0.0;  // of a step along a line over its length
  Vec3 reference = Vec3::Zero();
  std::array<double, 2> longest{};  // of the columns of A, of B, at most [m]
};

/// Buffers of one thread, empty between calls but for their capacity; slices of panels point here.
struct PanelArena {
  std::vector<SigmaRay> node;
  std::vector<std::uint16_t> level;
  std::vector<PanelPoint> point;
  /// A place on a side of a panel where the patch goes on beyond it, as the panel's lines have it, and rays near it.
  struct Crossing {
    std::array<double, 2> place;
    double width;            // of the patch along the side that the place stands for [m]
    std::uint8_t across;     // the coordinate that leads beyond the side
    bool upper;              // by rising
    Slice near;
  };
  std::vector<Crossing> crossing;

  // Of one pass over panels.
  struct Line {
    std::uint32_t panel;
    std::array<double, 2> base;       // a place of it
    double begin, end, weight;
    std::uint32_t first, stride;      // of its rays
    Slice ends;
    std::optional<LineSlot> missed;
    bool dead;                        // a level is negative all along
  };
  struct Search {
    std::uint32_t line;
    std::uint16_t level;
    LevelRoot root;
    double place;
    double drift;  // of the place, from line to line
    bool inside;  // the level is positive at the first ray of the lattice
    bool found;
  };
  struct Piece {
    std::uint32_t line, first, stride;
    double begin, end;
    bool lattice;  // its rays are those of the lattice, else of `cut_ray`
  };
  std::vector<SigmaRay> ray, cut_ray;
  std::vector<Line> line;
  std::vector<Search> search;
  std::vector<Piece> piece;
  std::vector<LineEnd> end;
  std::vector<LineShape> shape;
  std::vector<LevelQuery> query;
  std::vector<LevelValue> value, least;  // of queries; at each ray the level that bounds the patch most, as a pressure
  /// What third bodies may take of a panel between its lines, and where.
  struct Hidden {
    double area = 0.0, load = 0.0, most = 0.0, place = 0.0;
  };
  std::vector<Hidden> hidden;  // by panel
  /// Where a line of a star leaves the patch.
  struct RimEnd {
    bool found = false;
    double drift = 0.0;
    std::uint32_t ray = 0;                // of `rim_ray`
    Slice values;                         // of `rim_value`: of the levels that are not the rim, in the panel's order
    LineSlot missed{};                    // where a third body has the line up to there: by how much
    bool taken = false;
  };
  std::vector<RimEnd> rim;  // by line
  /// A level where it seems to turn along a line.
  struct Turn {
    std::uint32_t line;
    std::uint16_t level;
    LevelSample sample;
  };
  std::vector<Turn> turn, near_zero;
  std::vector<SigmaRay> rim_ray;
  std::vector<LevelValue> rim_value;
  std::vector<Search> rim_search;
  std::vector<LevelSample> sample;
  std::vector<LevelRoot> root;
  std::vector<std::uint32_t> open, compared;
  std::vector<LineSlot> slot;
  std::vector<std::pair<double, std::uint32_t>> event;
  RayScratch rays;
  LevelScratch levels;

  void clear() {
    node.clear();
    level.clear();
    point.clear();
    crossing.clear();
  }
};

/// The ray of a panel at a place, from the nearest ray that is known.
[[nodiscard]] SigmaRay start_ray(const PlaneChart& chart, const Panel& panel, const PlaneChart::Place& place, std::span<const SigmaRay> near);

/// A panel is to be split in the middle of its longer side, as places in the plane lie.
void part_longer(const PlaneChart& chart, Panel& panel);

/// Fills sums, errors and points of the panels `which`.
void measure_panels(PanelSetting& setting, std::span<Panel> panels, std::span<const std::uint32_t> which, PanelArena& arena);

}  // namespace supple::collision
