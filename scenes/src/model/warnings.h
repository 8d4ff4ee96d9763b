/// What a user may want to know of a scene that runs all the same, as sentences.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "simulation/frame.h"

namespace supple::scenes {

/// Whether bodies are so deep in one another that contact need not push them out: the middle of a primitive lies in the other.
/// @param frame  of the contacts at the start
[[nodiscard]] bool begins_deep(const std::vector<Body>& bodies, const Frame& frame, const collision::BodyPair& pair);

/// What is odd about the start: bodies deep in one another, parts of an object that pass through each other, objects without a
/// surface, cells and samples of contact that miss objects, meshes of obstacles that had to be mended, and keys
/// without an effect.
/// @param frame  of the contacts at the start
[[nodiscard]] std::vector<std::string> find_odd_start(const Scene& scene, const StageContext& context, const core::ParticleState& particles,
                                                      Frame& frame);

/// Adds, once each, contacts that the only rule allowed does not fit: they push nobody.
void add_unresolved(const StageContext& context, RuleName only, const collision::ContactSurface& surface,
                    std::vector<std::string>& warnings);

/// Whether a contact's bound of the error is above what was asked by more than rules end at.
[[nodiscard]] bool misses_error(const collision::ContactSurface::Summary& contact, double asked);

/// Contacts whose bound of the error is larger than asked, by the objects that touch. Starts anew after a restart.
class UnmetContacts {
 public:
  /// At the end of a step. @param time  [s]
  void look(const StageContext& context, const collision::ContactSurface& surface, double time);
  /// One sentence for each two objects.
  void add_to(double asked, std::vector<std::string>& warnings) const;

 private:
  struct Worst {
    double bound = 0.0, time = 0.0, first = 0.0;
    std::uint64_t times = 0;
  };
  std::map<std::pair<std::string, std::string>, Worst> worst_;
};

/// Held volumes that the last step did not find within 0.5 % of their targets, one sentence an object: the one that is off most, and whether its kernels
/// may change no further or still do. @param volumes  State::volumes
void add_missed_volumes(const Model& model, const std::vector<implicit::VolumeState>& volumes, std::vector<std::string>& warnings);

/// What searches for missed pieces of meshes found in all frames, in one sentence that takes the place of the last; none for none.
/// Another one counts triangles that cross, others tell of bulges that hold too little.
/// Other meshers than those that are searched are left to the report: the scene asks for them.
void set_missed(const MeshingDesc& meshing, const SearchCounts& all, std::vector<std::string>& warnings);

}  // namespace supple::scenes
