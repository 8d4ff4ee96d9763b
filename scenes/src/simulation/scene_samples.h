/// Even samples of the surfaces of a scene, carried from frame to frame.
#pragma once

#include <vector>

#include "supple/core/executor.h"
#include "supple/core/io/vtk_files.h"
#include "supple/implicit/even_samples.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Its content follows from the states of the frames passed to it, so it is not part of State: outputs of a run that was
/// resumed, or of saved states, pass the earlier frames again.
class SceneSamples {
 public:
  /// @param cell  lattice cell of the scene's meshes [m]
  SceneSamples(const SamplingDesc& sampling, double cell);

  /// Updates the samples to the present frame. The pieces of a body that broke since the last frame get new samples.
  void follow(Simulation& simulation, const Executor& executor);

  /// @throws Error{Limit} as follow() would for the size of a body
  void expect_sizes(Simulation& simulation, const Executor& executor) const;

  /// The samples of the last frame followed, with id, object, owner (number of the particle), normal and area.
  [[nodiscard]] io::PointSet points() const;

 private:
  struct OfBody {
    std::uint32_t object = 0;
    std::vector<std::uint32_t> particle;
    implicit::EvenSampleSet set;
  };
  implicit::EvenSampler sampler_;
  std::vector<OfBody> bodies_;
};

}  // namespace supple::scenes
