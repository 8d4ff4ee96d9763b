/// @file supple/scenes/accuracy.h
/// The key `accuracy`: one number a, the error of positions over the size of the bodies, from which the parameters of every stage follow. Keys that a
/// scene gives override them. A scene without the key that fixes neither its steps nor its method moves by a = 1e-2; its meshes and pictures keep their own
/// defaults.
///
/// | stage    | key                     | rule                                   | why                                                        |
/// |----------|-------------------------|----------------------------------------|------------------------------------------------------------|
/// | contact  | contact.error           | a                                      | a relative error a of a force changes a bounce by about a  |
/// | time     | time_step               | omega dt and v dt / length as the root of a / 1e-2 | all methods that are chosen are of second order    |
/// | friction | contact.friction_speed  | slip below min(1e-2, 10 a) of the pair's speed may count as sticking | its error is far smaller, and Newton's method converges |
/// | solver   | integrator.tolerance    | a / 1000                               | the next correction is the square of the last one |
/// | meshes   | output.meshing.error    | a of the size of the smallest object, 1e-4 at least | a picture shows no smaller errors              |
/// | pictures | render.noise            | 10 a, in [0.01, 0.1]                   | the filter leaves about a tenth of the noise               |
///
/// Samples only find contacts; their spacing stays a sixth of the thickness, primitive by primitive, or a third where contact.error is 5e-2 or more.
#pragma once

#include <optional>
#include <string>

#include "supple/core/integrate.h"
#include "supple/scenes/scene.h"

namespace supple::scenes {

/// Accuracy of the motion where a scene gives none.
inline constexpr double kDefaultAccuracy = 1e-2;

/// Bounds of one time step.
struct StepBounds {
  double phase = 0.3;   ///< omega dt, omega the largest frequency that a method resolves [rad]
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

/// Estimated error of particle positions at the end of a run that one stage causes.
struct ErrorEstimate {
  double position = 0.0;   ///< [m]
  double share = 0.0;      ///< over the size of the object [1]
  std::string object{};    ///< where the share is largest; empty: not known
  int frames = 0;          ///< simulated twice for the estimate
};

/// Estimated errors of the stages of a run.
struct StageErrors {
  ErrorEstimate time;      ///< by the difference to steps twice as long, summed over the frames of a sample and scaled to all
  ErrorEstimate contact;   ///< likewise to a tenth of contact.error; of runs with an accuracy
  ErrorEstimate mesh;      ///< the error to which meshes are made
  double work = 0.0;       ///< counted, of the frames that were simulated again, over that of the run
};

/// @param accuracy  in [1e-5, 4e-2]
[[nodiscard]] AccuracyRules accuracy_rules(double accuracy);

/// Sets the keys of pictures that follow from an accuracy. @pre no keys have been read into the scene yet
void set_by_accuracy(double accuracy, Scene& scene);

/// Whether a scene says nothing of its steps and of the method, and every law has an energy, as methods that `accuracy` chooses among need.
[[nodiscard]] bool leaves_steps_open(const Scene& scene);

/// Accuracy of the motion: that of the scene, or the default of a scene that leaves its steps open; none where the scene fixes them.
[[nodiscard]] std::optional<double> accuracy_of(const Scene& scene);

/// Relative error of contact that a scene asks for, by its key or its accuracy [1].
[[nodiscard]] double contact_error(const Scene& scene);

/// Limits for `core::stable_step`, which keeps to the default bounds, so that its step keeps to these.
[[nodiscard]] core::StepLimits scaled(core::StepLimits limits, const StepBounds& bounds);

}  // namespace supple::scenes
