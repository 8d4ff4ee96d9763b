/// @file panel_pass.h
/// One pass of a rule over panels, in the order of its functions: rays of a lattice, roots of levels along its lines, pieces between them, sums, and what these
/// may miss.
#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "surface/panels/panels.h"
#include "surface/quadrature.h"

namespace supple::collision::panel_pass {

using Plane = std::array<double, 2>;

inline std::size_t across(const Panel& panel, std::size_t k) { return static_cast<std::size_t>(k == 0 ? first_across(panel.along) : second_across(panel.along)); }
inline double low_of(const Panel& panel, std::size_t k) { return panel.low[across(panel, k)]; }
inline double width_of(const Panel& panel, std::size_t k) { return panel.high[across(panel, k)] - low_of(panel, k); }

inline void part(Panel& panel, std::size_t coordinate, double place) {
  panel.parting = static_cast<std::uint8_t>(coordinate);
  panel.parting_place = place;
}

inline void part_middle(Panel& panel, std::size_t coordinate) { part(panel, coordinate, low_of(panel, coordinate) + 0.5 * width_of(panel, coordinate)); }

/// One pass over panels with a rule of one order.
class Pass {
 public:
  Pass(PanelSetting& setting, std::span<Panel> panels, std::span<const std::uint32_t> which, int order, PanelArena& arena)
      : s_(setting), panels_(panels), which_(which), order_(order), n_(static_cast<std::size_t>(order)), gauss_(gauss_rule(order)), a_(arena) {}

  void place_lattice();
  void look_at_lattice();
  void bracket_between_walls();
  void make_lines();
  void find_least();
  void predict();
  void search();
  void join_rims();
  void make_pieces();
  /// @param first  of the two orders: points are kept
  void add_up(bool first);

 private:
  [[nodiscard]] Plane lattice_place(const Panel& panel, std::size_t i, std::size_t j) const {
    return {low_of(panel, 0) + gauss_.node[i] * width_of(panel, 0), low_of(panel, 1) + gauss_.node[j] * width_of(panel, 1)};
  }
  /// The rays of the panel that a line belongs to.
  [[nodiscard]] std::span<const SigmaRay> lattice_of(std::uint32_t line) const { return std::span<const SigmaRay>(a_.ray).subspan((line / n_) * n_ * n_, n_ * n_); }
  [[nodiscard]] SigmaRay start_ray(const Panel& panel, const Plane& place, std::span<const SigmaRay> near) const { return collision::start_ray(s_.chart, panel, place, near); }
  /// A ray of the lattice as far as it tells what is beside it.
  struct Node {
    Plane at;
    double pressure;  // or what else bounds the patch more
    Plane slope;
    bool found;
  };
  [[nodiscard]] Node node(std::size_t k, std::size_t i) const {
    const SigmaRay& ray = a_.ray[k * n_ * n_ + i];
    const LevelValue& least = a_.least[k * n_ * n_ + i];
    return {ray.place, least.value, least.slope, ray.found};
  }
  void look_beyond(Panel& panel, std::size_t k, bool upper, double& most) const;
  void look_aside(Panel& panel, std::size_t k, std::size_t in, bool upper, double& most) const;
  void look_between(Panel& panel, std::size_t k, double most) const;
  void evaluate(std::span<const SigmaRay> rays);
  [[nodiscard]] double stretch_of(const Panel& panel) const { return s_.chart.stretch({low_of(panel, 0) + 0.5 * width_of(panel, 0), low_of(panel, 1) + 0.5 * width_of(panel, 1)}); }
  void look_across(std::size_t k, std::size_t row, std::size_t stride);
  void look_beside(std::size_t k, std::size_t rim, std::size_t row, std::size_t stride);
  void sample_beside(std::size_t k, bool upper, bool side, std::size_t row, std::size_t stride);
  double negative_length(const Panel& panel, double limit);
  void hide(std::size_t k, double area, double load, double place);
  void sample_line(std::uint32_t line, std::uint16_t level, std::size_t row, std::size_t stride, const std::optional<LevelSample>& end);
  [[nodiscard]] bool may_turn(std::uint32_t line, std::size_t row, std::size_t stride) const;
  void look_at_turns();
  void predict_line(std::uint32_t line, std::uint16_t level, std::size_t row, std::size_t stride, const std::optional<LevelSample>& end);
  void predict_all(bool rims);
  void meet_rims();
  void look_at_rim(std::uint32_t line);
  [[nodiscard]] std::optional<LevelSample> at_rim(std::uint32_t line, std::size_t level) const;
  void step_searches();
  bool judge(PanelArena::Search& search, const LevelValue& value, const SigmaRay& ray);
  void cut_line(std::uint32_t line);
  void add_piece(std::uint32_t line, double begin, double end);
  void judge_panel(std::size_t k, const Plane& rough);
  void note_crossings(const Panel& panel);
  bool judge_slots(std::size_t k, double& most);
  void judge_sides(std::size_t k, double& most);
  void judge_corners(std::size_t k, double& most);
  void add_corner(Panel& panel, const PanelCorner& corner, double& most) const;
  void add_flux(const Vec3& at, const SigmaRay& ray, double area, PatchSums& sums) const;
  double add_points(const PanelArena::Piece& piece, Panel& panel, PatchSums& sums, bool first);

  PanelSetting& s_;
  std::span<Panel> panels_;
  std::span<const std::uint32_t> which_;
  int order_;
  std::size_t n_;
  const GaussRule& gauss_;
  PanelArena& a_;
};

}  // namespace supple::collision::panel_pass
