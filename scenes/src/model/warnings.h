/// Warnings about valid scenes, as sentences.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "simulation/frame.h"

namespace supple::scenes {

/// Whether bodies overlap so deeply that contact may not separate them: the centre of a primitive lies in the other body.
/// @param frame  of the contacts at the start
[[nodiscard]] bool begins_deep(const std::vector<Body>& bodies, const Frame& frame, const collision::BodyPair& pair);

/// Warnings about the initial state: bodies deep in one another, parts of an object that pass through each other, objects without a
/// surface, cells and samples of contact that miss objects, meshes of obstacles that are modified, obstacles of the default stiffness
/// that are far softer than objects, and keys without an effect.
/// @param frame  of the contacts at the start
[[nodiscard]] std::vector<std::string> find_odd_start(const Scene& scene, const StageContext& context, const core::ParticleState& particles,
                                                      Frame& frame);

/// Adds, once each, contacts that the given rule does not fit, which have no force.
void add_unresolved(const StageContext& context, RuleName only, const collision::ContactSurface& surface,
                    std::vector<std::string>& warnings);

/// Whether the error estimate of a contact exceeds the given error by more than the tolerance of the rules.
[[nodiscard]] bool misses_error(const collision::ContactSurface::Summary& contact, double given_error);

/// Contacts whose error estimate exceeds the given error, by objects. Starts empty after a restart.
class UnmetContacts {
 public:
  /// At the end of a step. @param time  [s]
  void look(const StageContext& context, const collision::ContactSurface& surface, double time);
  /// One sentence per pair of objects.
  void add_to(double given_error, std::vector<std::string>& warnings) const;

 private:
  struct Worst {
    double bound = 0.0, time = 0.0, first = 0.0;
    std::uint64_t times = 0;
  };
  std::map<std::pair<std::string, std::string>, Worst> worst_;
};

/// Volumes that differ from their targets by more than 0.5 % after the last step, one sentence per object: the largest difference, and whether its kernels
/// are at a limit or still change. @param volumes  State::volumes
void add_missed_volumes(const Model& model, const std::vector<implicit::VolumeState>& volumes, std::vector<std::string>& warnings);

/// Results of the searches for missed pieces of meshes in all frames, in one sentence that replaces the earlier one; none for none.
/// Further sentences count intersecting triangles and name bulges that hold too little volume.
/// Meshes by other methods are counted in the report only, as the scene chooses the method.
void set_missed(const MeshingDesc& meshing, const SearchCounts& all, std::vector<std::string>& warnings);

}  // namespace supple::scenes
