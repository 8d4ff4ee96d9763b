/// @file supple/collision/soft_body.h
/// Contact of bodies that the caller owns, without a scene: everything that contact needs of a body is made here, samples of its surface
/// included, so that bodies of any shape touch.
///
///     supple::implicit::Skeleton ball{.part_count = 1};
///     ball.primitive.push_back({.kernel = supple::implicit::Kernel::wyvill(1.0)});
///     const supple::collision::SoftBody left(ball, {.modulus = 2e4}, {{.position = {-0.3, 0, 0}}});
///     const supple::collision::SoftBody right(ball, {.modulus = 2e4}, {{.position = {0.3, 0, 0}}});
///     std::cout << supple::collision::touch(left, right).loads[0].force[0].transpose() << " N\n";
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "supple/collision/bodies.h"
#include "supple/collision/contact_surface.h"
#include "supple/implicit/field.h"

namespace supple::collision {

class SoftBody {
 public:
  /// @param pose  of the parts, shape [skeleton.part_count]   @pre a primitive, and a modulus > 0
  SoftBody(implicit::Skeleton skeleton, ContactMaterial material, std::vector<Pose> pose);
  ~SoftBody();
  SoftBody(SoftBody&&) noexcept;
  SoftBody& operator=(SoftBody&&) noexcept;

  /// @param pose  of the parts, shape [part_count]
  void move(std::vector<Pose> pose);
  /// Velocities of the parts' centres [m/s] and angular velocities, world axes [rad/s], shape [part_count]; they are 0 at first.
  void set_motion(std::vector<Vec3> velocity, std::vector<Vec3> angular_velocity);

  [[nodiscard]] const implicit::Field& field() const;
  [[nodiscard]] const std::vector<Pose>& pose() const;
  /// For functions that take spans of bodies; valid until the next change of this object.
  [[nodiscard]] ContactBody view() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The contact of two bodies.
struct Touch {
  ContactSurface surface;          ///< its summary is empty where they do not touch
  std::array<PartLoads, 2> loads;  ///< on the parts of both bodies, damping and friction included
};
/// @param error  relative, of force, area and centre of pressure, in [1e-10, 0.1]; surface.summary[0].error_estimate is the achieved one
[[nodiscard]] Touch touch(const ContactBody& a, const ContactBody& b, double error = 1e-4);
[[nodiscard]] Touch touch(const SoftBody& a, const SoftBody& b, double error = 1e-4);

}  // namespace supple::collision
