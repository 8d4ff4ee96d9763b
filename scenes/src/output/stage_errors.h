/// @file stage_errors.h
/// Estimates the error of positions that each stage of a run causes. A sample of the frames with contact, and one of those without, is simulated again from
/// the state before: with steps twice as long (half as long where a frame is one step) and, of scenes with an accuracy, given or by default, with a tenth of contact.error.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <vector>

#include "supple/scenes/accuracy.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

class StageErrorEstimator {
 public:
  /// @param options  of the run  @param last_frame  that it simulates
  StageErrorEstimator(const Scene& scene, const SimulationOptions& options, int last_frame);
  /// Before `simulation` makes its next frame.
  void begin(const Simulation& simulation);
  /// After it has. @return CPU time that this took [s]
  double end(const Simulation& simulation);
  [[nodiscard]] StageErrors estimate(const Model& model) const;

 private:
  /// A second simulation, made when it is first needed, and the differences of its frames.
  struct Variant {
    std::optional<Simulation> simulation;
    std::array<int, 2> frames{};                ///< by whether anything touched in them
    std::array<std::vector<double>, 2> sum{};   ///< likewise, by object: displacement by the end of the run caused by these frames [m]
  };
  void compare(const Simulation& simulation, int finer, double contact_error, Variant& variant);
  [[nodiscard]] ErrorEstimate estimate_of(std::initializer_list<const Variant*> variants, const Model& model) const;

  const Scene& scene_;
  SimulationOptions options_;
  int last_frame_;
  std::optional<State> before_;
  std::uint64_t touched_ = 0;        ///< points of contact, before the frame
  std::size_t kind_ = 0;             ///< of the frame: whether anything touched
  std::array<int, 2> seen_{};        ///< frames, by that
  Variant coarser_, finer_, contact_;
};

}  // namespace supple::scenes
