/// Particles from CSV and PLY files.
#include "supple/core/io/particle_files.h"

#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "supple/core/error.h"
#include "support/temp_folder.h"

namespace supple::io {
namespace {

namespace fs = std::filesystem;

class ParticleFiles : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path file(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }
  std::string fault(const std::string& name, const std::string& text) const {
    try {
      (void)read_particles(file(name, text), 3);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  }
  fs::path folder_ = temp_folder() / "particle_files";
};

TEST_F(ParticleFiles, HoldPlacesAlone) {
  const core::Arrangement found = read_particles(file("a.csv", "x,y,z\n1,2,3\n4,5,6\n"), 10);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found.position[1], Vec3(4, 5, 6));
  EXPECT_TRUE(found.mass.empty());
}

TEST_F(ParticleFiles, HoldEverythingOfAParticle) {
  const core::Arrangement found = read_particles(
      file("a.csv", "mass_kg,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,nx,ny,nz,radius\n2,1,2,3,7,8,9,0,2,0,0.1\n3,0,0,0,0,0,0,0,0,1,0.2\n"), 10);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found.position[0], Vec3(1, 2, 3));
  EXPECT_EQ(found.velocity[0], Vec3(7, 8, 9));
  EXPECT_EQ(found.mass[1], 3.0);
  EXPECT_EQ(found.inertia_radius[1], 0.2);
  EXPECT_LT((found.orientation[0] * Vec3::UnitZ() - Vec3::UnitY()).norm(), 1e-15);  // body z is the normal
}

TEST_F(ParticleFiles, KeepANormalBesideAnOrientation) {
  const core::Arrangement found = read_particles(file("a.csv", "x y z qw qx qy qz nx ny nz\n0 0 0 0 0 0 2 1 0 0\n"), 10);
  EXPECT_LT((found.orientation[0] * found.normal[0] - Vec3::UnitX()).norm(), 1e-15);
  EXPECT_LT((found.normal[0] + Vec3::UnitX()).norm(), 1e-15);  // half a turn about z
}

TEST_F(ParticleFiles, MayBePly) {
  const core::Arrangement found = read_particles(
      file("a.ply", "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nproperty double mass\n"
                    "property list uchar int others\nend_header\n1 2 3 0.5 2 7 8\n4 5 6 0.25 0\n"), 10);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found.position[1], Vec3(4, 5, 6));
  EXPECT_EQ(found.mass[0], 0.5);
}

TEST_F(ParticleFiles, SayWhatIsWrong) {
  EXPECT_NE(fault("a.csv", "ply\nformat ascii 1.0\n").find("found a PLY file; give the file a name that ends in .ply"), std::string::npos) << fault("a.csv", "ply\n");
  EXPECT_NE(fault("a.csv", "x,y,z,vx,vy\n1,2,3,4,5\n").find("none named vz"), std::string::npos);
  EXPECT_NE(fault("a.csv", "x,y,z,mass\n1,2,3,0\n").find("expected 'mass' > 0"), std::string::npos);
  EXPECT_NE(fault("a.csv", "x,y,z,mass\n1,2,3\n").find("a.csv:2: expected 4 numbers"), std::string::npos) << fault("a.csv", "x,y,z,mass\n1,2,3\n");
  EXPECT_NE(fault("a.csv", "x,y,z,mass\n1,2,nan,1\n").find("expected finite numbers"), std::string::npos);
  EXPECT_NE(fault("a.csv", "x,y,z,mass\n1,2,3,1e51\n").find("expected 'mass' up to 1e50 in size, found 1e+51 of particle 0"), std::string::npos);
  EXPECT_NE(fault("a.csv", "x,y,z,radius\n1,2,3,1e-51\n").find("expected 'radius' > 0, at least 1e-50, found 1e-51"), std::string::npos);
  EXPECT_NE(fault("a.csv", "x,y,z,vx,vy,vz\n0,0,0,1,1,1\n0,0,0,0,-1e51,0\n").find("expected 'vy' up to 1e50 in size, found -1e+51 of particle 1"), std::string::npos);
  EXPECT_EQ(fault("a.csv", "x,y,z,vx,vy,vz\n1e-300,0,1e50,-1e50,1e-300,0\n"), "accepted");
  EXPECT_NE(fault("a.csv", "x,y,z,nx,ny,nz\n1,2,3,0,0,0\n").find("normal that is not zero"), std::string::npos);
  EXPECT_NE(fault("a.csv", "a,b,c,d\n1,2,3,4\n").find("expected columns x, y and z"), std::string::npos);
  EXPECT_NE(fault("a.csv", "x,y,z,mass\n1,2,3,1\n1,2,4,1\n1,2,5,1\n1,2,6,1\n").find("at most 3 particles"), std::string::npos);
}

}  // namespace
}  // namespace supple::io
