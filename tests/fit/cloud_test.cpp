// Points as data, with and without normals.
#include <gtest/gtest.h>

#include <fstream>

#include "fit/shapes.h"
#include "fit/surface.h"
#include "supple/core/error.h"

namespace supple::fit {
namespace {

Mesh egg() {
  return test::moved_sphere(4, [](const Vec3& p) { return Vec3(0.3 * p.x() + 1.0, 0.2 * p.y(), 0.2 * p.z()); });
}

std::string rows(const Mesh& mesh, bool normals) {
  std::ostringstream out;
  for (const Vec3& p : mesh.position) {
    out << p.transpose();
    // Of the ellipsoid: the gradient of its quadratic form.
    if (normals) out << ' ' << Vec3((p.x() - 1.0) / 0.09, p.y() / 0.04, p.z() / 0.04).normalized().transpose();
    out << '\n';
  }
  return out.str();
}

std::filesystem::path written(const std::string& name, const std::string& content) {
  const std::filesystem::path path = temp_folder() / name;
  std::ofstream(path) << content;
  return path;
}

void expect_egg(const std::filesystem::path& file, bool normals) {
  Repair repair;
  const Mesh mesh = read_surface(file, {.error = 0.02}, repair, Executor(2));
  const MeshReport report = inspect(mesh);
  EXPECT_TRUE(report.closed);
  EXPECT_EQ(report.components, 1U);
  EXPECT_EQ(report.euler_characteristic, 2);
  EXPECT_NEAR(report.volume / (4.0 / 3.0 * std::numbers::pi * 0.3 * 0.2 * 0.2), 1.0, 0.03) << file;
  EXPECT_EQ(repair.points, egg().position.size());
  EXPECT_EQ(repair.normals_given, normals);
  EXPECT_LT(repair.points_rms, 0.004);
}

TEST(FitCloud, ReadsXyzWithAndWithoutNormals) {
  expect_egg(written("bare.xyz", "# x y z\n" + rows(egg(), false)), false);
  expect_egg(written("oriented.xyz", rows(egg(), true)), true);
}

TEST(FitCloud, ReadsPlyWithoutFaces) {
  const std::string head = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(egg().position.size()) + "\nproperty double x\nproperty double y\nproperty double z\n";
  expect_egg(written("bare.ply", head + "end_header\n" + rows(egg(), false)), false);
  expect_egg(written("oriented.ply", head + "property double nx\nproperty double ny\nproperty double nz\nend_header\n" + rows(egg(), true)), true);
}

TEST(FitCloud, RefusesWhatIsNoSurface) {
  const auto message = [](const std::string& name, const std::string& text) {
    Repair repair;
    try {
      (void)read_surface(written(name, text), {}, repair, Executor(1));
    } catch (const Error& error) {
      const std::string what = error.what();
      return what.substr(what.find(name));
    }
    return std::string("no fault");
  };
  EXPECT_EQ(message("row.xyz", "0 0 0\n\n1 2\n"), "row.xyz:3: expected three coordinates, or these and a normal, found 1 2; remove lines that are no points");
  EXPECT_EQ(message("few.xyz", "0 0 0\n1 0 0\n0 1 0\n"), "few.xyz: expected at least 50 different points, found 3; sample the surface more densely");
}

}  // namespace
}  // namespace supple::fit
