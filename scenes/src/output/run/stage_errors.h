/// @file stage_errors.h
/// Estimates the error of positions that each stage of a run causes. A sample of the frames with contact, and one of those without, is simulated again from
/// the state before: with steps twice as long (half as long where a frame is one step; the adaptive method with a hundredth of its tolerance) and, of scenes
/// with an accuracy, given or by default, with a tenth of contact.error.
/// But for the first of each kind, a frame for which the work on either of these would exceed a tenth of that of the run so far is passed over for the next one.
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
  /// What is other than in the run.
  struct Change {
    int finer = 0;                ///< halvings of the step
    double contact_error = 0.0;   ///< relative
    std::optional<double> tolerance;  ///< integrator.tolerance
    double share = 1.0;           ///< error of the run, over the difference
  };
  /// An object in the second simulation of a frame.
  struct Difference {
    double apart = 0.0;     ///< estimated error of positions, the largest [m]
    double velocity = 0.0;  ///< likewise of the object as a whole, or of separate particles [m/s]
    double speed = 0.0;     ///< mean over its particles in the frame [m/s]
    double path = 0.0;      ///< mean since the begin of the run [m]
    double left = 0.0;      ///< time until the end of the run [s]
  };
  /// A second simulation, made when it is first needed, and the differences of its frames.
  struct Variant {
    explicit Variant(double costs) : cost(costs) {}
    double cost;                                                  ///< of its work on a frame, over that of the run: as expected, then of the last frame
    double spent = 0.0;                                           ///< work on all frames
    std::array<bool, 2> due{};                                    ///< by whether anything touches, as `frames`
    std::optional<Simulation> simulation;
    std::array<int, 2> frames{};                                  ///< by whether anything touched in them
    std::array<std::vector<std::vector<Difference>>, 2> found{};  ///< likewise, by object
  };
  void follow(const Simulation& simulation);
  void compare_if_due(const Simulation& simulation, const Change& change, Variant& variant);
  /// Displacement at the end of the run by the difference of a frame [m].
  [[nodiscard]] double displacement(const Difference& found, std::size_t object) const;
  void compare(const Simulation& simulation, const Change& change, Variant& variant);
  [[nodiscard]] ErrorEstimate estimate_of(std::initializer_list<const Variant*> variants, const Model& model) const;

  const Scene& scene_;
  SimulationOptions options_;
  int last_frame_;
  std::optional<State> before_;
  std::vector<double> path_;         ///< by object: mean of its particles [m]
  std::vector<double> moved_;        ///< in the last frame [m]
  std::uint64_t touched_ = 0;        ///< points of contact, before the frame
  std::size_t kind_ = 0;             ///< of the frame: whether anything touched
  std::array<int, 2> seen_{};        ///< frames, by that
  std::uint64_t before_work_ = 0;    ///< of the run, before the frame
  double work_ = 0.0, all_work_ = 0.0;  ///< of the frame, of all frames
  Variant coarser_{0.5}, finer_{2.0}, contact_{4.0};
};

}  // namespace supple::scenes
