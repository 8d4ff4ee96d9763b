// Points as data, with and without normals.
#include <gtest/gtest.h>

#include <fstream>
#include <memory>

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

/// Blocks of memory of many sizes with gaps between them: what is asked for next lies in another order.
std::vector<std::unique_ptr<std::byte[]>> scattered(std::size_t count) {
  std::vector<std::unique_ptr<std::byte[]>> out;
  std::size_t size = 1;
  for (std::size_t k = 0; k < count; ++k) {
    size = (size * 48271) % 2147483647;
    out.push_back(std::make_unique<std::byte[]>(1 + size % 60000));
  }
  for (std::size_t k = 0; k < count; k += 2) out[k].reset();
  return out;
}

TEST(FitCloud, IsTheSameWhereverMemoryLies) {
  // Without the points of a cap, across which the surface is free.
  Mesh points = egg();
  std::erase_if(points.position, [](const Vec3& p) { return p.z() < -0.1; });
  const auto file = written("gap.xyz", rows(points, true));
  const auto surface = [&file](int threads) {
    Repair repair;
    return read_surface(file, {.error = 0.02}, repair, Executor(threads));
  };
  const Mesh first = surface(1);
  for (const std::size_t blocks : {300, 2000}) {
    const auto memory = scattered(blocks);
    const Mesh again = surface(2);
    EXPECT_EQ(again.position, first.position) << blocks;
    EXPECT_EQ(again.triangle, first.triangle) << blocks;
  }
}

TEST(FitCloud, TurnsNormalsAlikeWhereNeighboursDoNotConnectThem) {
  // Clusters of points on a sphere, each with more of them than a point has neighbours.
  std::ostringstream out;
  constexpr int kClusters = 200, kPoints = 25;
  constexpr double kSize = 0.05, kGolden = 2.399963229728653;
  for (int c = 0; c < kClusters; ++c) {
    const double z = (c + 0.5) / kClusters * 2.0 - 1.0, radius = std::sqrt(1.0 - z * z);
    const Vec3 middle(radius * std::cos(kGolden * c), radius * std::sin(kGolden * c), z);
    const Vec3 u = middle.unitOrthogonal(), v = middle.cross(u);
    for (int k = 0; k < kPoints; ++k) {
      const double away = kSize * std::sqrt((k + 0.5) / kPoints);
      out << (middle + away * (std::cos(kGolden * k) * u + std::sin(kGolden * k) * v)).normalized().transpose() << '\n';
    }
  }
  const auto file = written("clusters.xyz", out.str());
  Repair repair;
  const Mesh mesh = read_surface(file, {.error = 0.1}, repair, Executor(2));
  EXPECT_NEAR(inspect(mesh).volume / (4.0 / 3.0 * std::numbers::pi), 1.0, 0.03);
  EXPECT_EQ(inspect(mesh).components, 1U);
}

TEST(FitCloud, KeepsTwoObjectsApart) {
  const Mesh one = test::moved_sphere(4, [](const Vec3& p) { return Vec3(0.3 * p); }), other = test::moved_sphere(4, [](const Vec3& p) { return Vec3(0.2 * p + Vec3(2.0, 0.0, -0.3)); });
  const auto file = written("both.xyz", rows(one, false) + rows(other, false));
  Repair repair;
  try {
    (void)read_surface(file, {.error = 0.02}, repair, Executor(2));
    ADD_FAILURE() << "no fault";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("expected a mesh in one piece, found 2 pieces; choose the largest by --pieces largest"), std::string::npos) << error.what();
  }
  const Mesh mesh = read_surface(file, {.error = 0.02, .pieces = Pieces::Largest}, repair, Executor(2));
  EXPECT_NEAR(inspect(mesh).volume / (4.0 / 3.0 * std::numbers::pi * 0.027), 1.0, 0.05);
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
