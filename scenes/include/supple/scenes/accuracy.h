/// @file supple/scenes/accuracy.h
/// The key `accuracy`: one number a that every stage is set by, the error of positions over the size of the bodies. Keys that a scene gives
/// override what it sets.
///
/// | stage    | key                     | rule                                   | why                                                        |
/// |----------|-------------------------|----------------------------------------|------------------------------------------------------------|
/// | contact  | contact.error           | a                                      | a force that is off by a moves a bounce by about a of its way |
/// | time     | time_step               | omega dt and v dt / length as the root of a / 1e-2 | all methods that are taken are of second order     |
/// | friction | contact.friction_speed  | slower slips than min(1e-2, 10 a) of the pair's speed may be sticking | it errs by far less than its share, and Newton's method converges |
/// | solver   | integrator.tolerance    | a / 1000                               | a correction that is left out is the square of the last one |
/// | meshes   | output.meshing.error    | a of the size of the smallest object, 1e-4 at least | no picture shows less                          |
/// | pictures | render.noise            | 10 a, in [0.01, 0.1]                   | the filter leaves about a tenth of it                      |
///
/// Samples only find contacts; they stay a sixth of the smallest feature apart.
#pragma once

#include <string>

#include "supple/core/integrate.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// Of the method `implicit` where a scene names no accuracy.
inline constexpr double kDefaultAccuracy = 1e-2;

/// How far one step may go.
struct StepBounds {
  double phase = 0.3;   ///< omega dt, omega the largest frequency of what a method resolves [rad]
  double travel = 0.1;  ///< v dt over the smallest length [1]
};

struct AccuracyRules {
  double contact_error = 1e-4;
  double mesh_share = 0.0;
  double noise = 0.0;
  double tolerance = 1e-9;
  double slow_slip = 1e-3;
  StepBounds explicit_steps, implicit_steps;
};

/// How far one stage puts particles off by the end of a run, as an estimate.
struct ErrorEstimate {
  double position = 0.0;   ///< [m]
  double share = 0.0;      ///< over the size of the object [1]
  std::string object{};    ///< where the share is largest; empty: not known
  int frames = 0;          ///< that were made twice for it
};

/// Of the stages of a run.
struct StageErrors {
  ErrorEstimate time;      ///< the difference to steps twice as long, summed over the frames of a sample and scaled to all
  ErrorEstimate contact;   ///< likewise to a tenth of contact.error; of runs with `accuracy`
  ErrorEstimate mesh;      ///< what meshes are made to
};

/// @param accuracy  in [1e-5, 1e-2]
[[nodiscard]] AccuracyRules accuracy_rules(double accuracy);

/// Sets the keys of a scene that nothing has been read into yet.
void set_by_accuracy(double accuracy, Scene& scene);

/// Limits for `core::stable_step`, which keeps to the default bounds, so that its step keeps to these.
[[nodiscard]] core::StepLimits scaled(core::StepLimits limits, const StepBounds& bounds);

}  // namespace supple::scenes
