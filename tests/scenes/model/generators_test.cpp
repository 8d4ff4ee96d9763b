/// Arrangements of scene files: filled meshes, curves, scattered particles, files.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "supple/core/error.h"
#include "supple/scenes/model.h"
#include "supple/scenes/read_scene.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

class Generators : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  [[nodiscard]] Model model(const std::string& particles, const std::string& more = "") const {
    return build_model(parse_scene("schema: 1\nduration: 1\nobjects:\n  - name: a\n    particles: " + particles + "\n" + more, "test.yaml", folder_));
  }
  [[nodiscard]] std::string fault(const std::string& particles) const {
    try {
      (void)model(particles);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  }
  fs::path folder_ = temp_folder() / "generators";
};

constexpr const char* kCube = "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n"
                              "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

TEST_F(Generators, FillAClosedMesh) {
  write("cube.obj", kCube);
  const Model found = model("{arrange: fill, file: cube.obj, spacing: 0.3, at: [5, 0, 0]}");
  EXPECT_EQ(found.particles.size(), 7u * 7u * 7u);  // -0.9, -0.6, ... 0.9
  for (const Vec3& x : found.rest.position) EXPECT_LE((x - Vec3(5, 0, 0)).cwiseAbs().maxCoeff(), 1.0);
  EXPECT_NE(fault("{arrange: fill, file: absent.obj, spacing: 0.3}").find("particles.file"), std::string::npos);
  EXPECT_NE(fault("{arrange: fill, file: cube.obj, spacing: 0.001}").find("particles.spacing"), std::string::npos);
}

TEST_F(Generators, MakeElasticBodies) {
  write("cube.obj", kCube);
  const std::string material = "    material: {youngs_modulus: 1e4, density: 500}\n    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]\n";
  const Model cube = model("{arrange: fill, file: cube.obj, spacing: 0.3}", material);
  EXPECT_EQ(cube.interactions.bond_frame.at(0).law.size(), 3u * 7u * 7u * 6u + 6u * 7u * 6u * 6u);  // edges and face diagonals
  double mass = 0.0;
  for (const double m : cube.particles.mass) mass += m;
  EXPECT_NEAR(mass, 500.0 * cube.objects[0].solid_volume, 1e-9 * mass);
  const Model curve = model("{arrange: curve, count: 20, points: [[0, 0, 0], [1, 0, 0.5], [2, 0, 0]]}", material);
  EXPECT_EQ(curve.interactions.bond_frame.at(0).law.size(), 19u);
  EXPECT_NE(fault("{arrange: curve, count: 20, points: [[0, 0, 0], [0, 0, 0]]}").find("apart from the one before"), std::string::npos);
}

TEST_F(Generators, ScatterOrSayThatThereIsNoRoom) {
  EXPECT_EQ(model("{arrange: scatter, count: 50, size: [1, 1, 1], spacing: 0.1, seed: 3, inertia_radius: 0.05}").particles.size(), 50u);
  EXPECT_NE(fault("{arrange: scatter, count: 50, size: [1, 1, 1], spacing: 0.9}").find("enlarge 'size'"), std::string::npos);
}

TEST_F(Generators, TakeAllOfAParticleFromItsFile) {
  write("two.csv", "x,y,z,mass,radius,vx,vy,vz,nx,ny,nz\n0,0,0,2,0.1,1,0,0,1,0,0\n1,0,0,4,0.2,0,0,3,0,0,1\n");
  const Model found = model("{arrange: file, file: two.csv, axis: [1, 0, 0], velocity: [0, 1, 0]}");
  EXPECT_EQ(found.particles.mass[1], 4.0);
  EXPECT_NEAR(found.particles.inertia[1].x(), 0.4 * 4.0 * 0.04, 1e-15);
  EXPECT_LT((found.initial.velocity[1] - Vec3(3, 1, 0)).norm(), 1e-15);  // turned with the arrangement, z to x
  EXPECT_LT((found.initial.orientation[0] * found.particles.normal[0] - Vec3(0, 0, -1)).norm(), 1e-15);
}

TEST_F(Generators, TakeANormalInTheParticlesFrame) {
  const Model found = model("{arrange: line, count: 2, spacing: 1, own_normal: [0, 2, 0]}");
  EXPECT_EQ(found.particles.normal[0], Vec3::UnitY());
}

}  // namespace
}  // namespace supple::scenes
