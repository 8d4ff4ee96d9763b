/// What every field must keep, at random places.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "bodies.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit::testing {

template <class Solid>
void expect_gradients(const Solid& solid, double reach, double tolerance) {
  const FieldView field(solid);
  const double h = 1e-5;
  for (const Vec3& p : random_points(3, 200, reach)) {
    Vec3 gradient;
    std::ignore = field.value(p, gradient);
    for (int k = 0; k < 3; ++k) {
      const double forward = field.value(p + h * Vec3::Unit(k)) - field.value(p);
      const double backward = field.value(p) - field.value(p - h * Vec3::Unit(k));
      if (std::abs(forward - backward) > 1e-3 * h) continue;  // a crease between the two
      EXPECT_NEAR(0.5 * (forward + backward) / h, gradient[k], tolerance) << p.transpose();
    }
  }
}

template <class Solid>
void expect_bounds(const Solid& solid, double reach) {
  const std::vector<Vec3> corners = random_points(5, 100, reach);
  const std::vector<Vec3> inside = random_points(6, 50, 1.0);
  for (std::size_t i = 0; i + 1 < corners.size(); i += 2) {
    Box box;
    box.include(corners[i]);
    box.include(corners[i + 1]);
    const Interval bound = solid.bound(box);
    const double steepest = solid.gradient_bound(box);
    for (const Vec3& u : inside) {
      Vec3 gradient;
      const Vec3 p = box.centre() + 0.5 * u.cwiseProduct(box.extent());
      const double value = FieldView(solid).value(p, gradient);
      EXPECT_TRUE(bound.contains(value)) << value << " in [" << bound.lower << ", " << bound.upper << ']';
      EXPECT_LE(gradient.norm(), steepest);
    }
  }
}

}  // namespace supple::implicit::testing
