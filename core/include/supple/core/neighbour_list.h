/// @file supple/core/neighbour_list.h
/// Neighbour lists with a skin (Verlet 1967) for many particles: every particle has the particles nearer than
/// range + skin, packed for vector units; the list is kept until a particle has moved by half the skin. In open space or in a
/// periodic box.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "supple/core/executor.h"
#include "supple/core/hash.h"
#include "supple/core/neighbours.h"
#include "supple/core/pair_laws.h"
#include "supple/core/particles.h"
#include "supple/core/types.h"

namespace supple::core {

/// A box that repeats in all three directions. Positions may be anywhere: a particle represents all its images.
struct PeriodicBox {
  Vec3 origin = Vec3::Zero();  ///< [m]
  Vec3 length = Vec3::Zero();  ///< [m], > 0

  /// The shortest of the vectors that differ from r by whole box lengths [m].
  [[nodiscard]] Vec3 nearest_image(const Vec3& r) const;
};

/// The list and its order are a function of the reference positions alone, which are State: sums over the list are
/// added in its order, so that a run continues with the same bits only from the same reference positions. The same
/// bits for every number of threads and every vector width.
class NeighbourList {
 public:
  /// @param range  of the laws [m], > 0   @param skin  [m], > 0
  /// @pre a periodic box is at least 2 (range + skin) long in every direction
  NeighbourList(double range, double skin, const std::optional<PeriodicBox>& box = std::nullopt);
  ~NeighbourList();
  NeighbourList(NeighbourList&&) noexcept;
  NeighbourList& operator=(NeighbourList&&) noexcept;

  [[nodiscard]] double range() const;
  [[nodiscard]] const std::optional<PeriodicBox>& box() const;

  /// Takes new positions. Where a particle is farther than skin / 2 from its reference position these become the
  /// reference positions and the list is rebuilt. @return whether it was
  /// @pre positions are finite and less than 1e12 (range + skin) apart
  bool update(std::span<const Vec3> positions, const Executor& executor);

  /// All pairs of the list (i < j), sorted: those nearer than the range, and some up to range + skin.
  [[nodiscard]] std::vector<IndexPair> pairs() const;
  /// Entries of the list: each pair once, and padding of the last batch of a particle.
  [[nodiscard]] std::size_t entries() const;
  [[nodiscard]] std::size_t bytes() const;  ///< memory of the list and its buffers

  void save(StateWriter& out) const;
  void load(StateReader& in);
  void hash(Hasher& hasher) const;

  struct Impl;
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

/// U = 4 epsilon ((sigma/d)^12 - (sigma/d)^6), cut off at the range of the list without a shift.
struct TwelveSix {
  double epsilon = 1.0;  ///< [J]
  double sigma = 1.0;    ///< [m]
};

/// The laws of surface elements in one pass (Szeliski & Tonnesen 1992; Lombardo & Puech 1995): cohesion, and with the
/// weight psi of range h form, co-planarity, co-normality k psi |n_A - n_B|^2 and co-circularity
/// k psi ((n_A + n_B) . r)^2. h is the range of the list, and cohesion is cut off there. A gain 0 leaves a law out.
struct SurfaceLaws {
  Cohesion cohesion;           ///< f0 = 0: none
  double form = 0.0;           ///< [J m^2]
  double curvature = 0.0;      ///< of form [1/m]
  double coplanarity = 0.0;    ///< [N/m]
  double conormality = 0.0;    ///< [J]
  double cocircularity = 0.0;  ///< [N/m]
};

/// With SingleForces the force and the derivatives by normals of each pair are computed in single precision and added
/// up in double. Separations are exact to 2^-29 of range + skin before they are rounded to single precision. Both
/// particles of a pair get the same force, so momentum is conserved as in double; the moment of a pair, and with it
/// angular momentum, is only as exact as single precision, about 1e-7 of the forces times their distances.
enum class Precision : std::uint8_t { Double, SingleForces };

/// Adds the loads of a law between all particles of a list, at the positions of its last update.
/// @param normals  unit, world axes, shape [particles]
void accumulate_geometric(NeighbourList& list, const TwelveSix& law, const Executor& executor, Loads& loads,
                          Precision precision = Precision::Double);
void accumulate_geometric(NeighbourList& list, const SurfaceLaws& law, std::span<const Vec3> normals,
                          const Executor& executor, Loads& loads, Precision precision = Precision::Double);

}  // namespace supple::core
