#include "fit/jets.h"

#define CGAL_EIGEN3_ENABLED
#include <CGAL/Eigen_svd.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Monge_via_jet_fitting.h>

#include <vector>

namespace supple::fit {

SurfaceFrame measure_frame(std::span<const Vec3> points, const Vec3& normal) {
  using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
  using Fitting = CGAL::Monge_via_jet_fitting<Kernel, Kernel, CGAL::Eigen_svd>;
  std::vector<Kernel::Point_3> near;
  for (const Vec3& p : points) near.emplace_back(p.x(), p.y(), p.z());
  constexpr std::size_t kDegree = 2;
  Fitting fitting;
  Fitting::Monge_form form = fitting(near.begin(), near.end(), kDegree, kDegree);
  form.comply_wrt_given_normal({normal.x(), normal.y(), normal.z()});
  const auto plain = [](const Kernel::Vector_3& v) { return Vec3(v.x(), v.y(), v.z()); };
  // CGAL's surface is z = (k1 x^2 + k2 y^2) / 2 along the normal.
  return {plain(form.normal_direction()), plain(form.maximal_principal_direction()), -form.principal_curvatures(0), -form.principal_curvatures(1)};
}

}  // namespace supple::fit
