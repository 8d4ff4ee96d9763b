#include "supple/core/io/read_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>


#include "supple/core/error.h"
#include "supple/core/io/mesh_files.h"
#include "support/temp_folder.h"

namespace supple::io {
namespace {

namespace fs = std::filesystem;

class ReadMesh : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path file(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }
  void expect_refused(const std::string& name, const std::string& text, const std::string& message) {
    try {
      (void)read_mesh(file(name, text));
      FAIL() << message;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Scene);
      EXPECT_NE(std::string(error.what()).find(message), std::string::npos) << error.what();
    }
  }
  fs::path folder_ = temp_folder() / "read_mesh";
};

Mesh tetrahedron() {
  Mesh mesh;
  mesh.position = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 2, 0), Vec3(0, 0, 0.5)};
  mesh.triangle = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  mesh.normal.assign(4, Vec3::UnitZ());
  mesh.columns.push_back({"pressure", {1, 2, 3, 4}});
  return mesh;
}

TEST_F(ReadMesh, ReadsBackWhatWasWritten) {
  const Mesh mesh = tetrahedron();
  write_obj(folder_ / "t.obj", mesh);
  write_ply(folder_ / "t.ply", mesh);
  for (const char* name : {"t.obj", "t.ply"}) {
    const Mesh read = read_mesh(folder_ / name);
    EXPECT_EQ(read.triangle, mesh.triangle) << name;
    EXPECT_EQ(read.position, mesh.position) << name;
  }
}

TEST_F(ReadMesh, CutsFacesIntoFansAndCountsFromTheLast) {
  const Mesh mesh = read_mesh(file("q.obj", "# a square\r\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\nf -1 -2 -3\n"));
  EXPECT_EQ(mesh.triangle, (std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {0, 2, 3}, {3, 2, 1}}));
  const Mesh text = read_mesh(file("q.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty uchar red\n"
                                            "property double z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n"
                                            "0 0 9 1\n1 0 9 2\n0 1 9 3\n3 0 1 2\n"));
  EXPECT_EQ(text.position[2], Vec3(0, 1, 3));
  EXPECT_EQ(text.triangle.size(), 1u);
}

TEST_F(ReadMesh, ReadsTextBehindAByteOrderMark) {
  const std::string mark = "\xEF\xBB\xBF", obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  const std::string ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
                          "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  for (const auto& [name, text] : {std::pair{"b.obj", obj}, std::pair{"b.ply", ply}}) {
    const Mesh mesh = read_mesh(file(name, mark + text));
    ASSERT_EQ(mesh.position.size(), 3u) << name;
    EXPECT_EQ(mesh.position[1], Vec3(1, 0, 0)) << name;
    EXPECT_EQ(mesh.triangle.size(), 1u) << name;
  }
}

TEST_F(ReadMesh, JoinsLinesOfObjThatEndInABackslash) {
  const Mesh mesh = read_mesh(file("j.obj", "v 0 0 \\\n0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 \\\r\n 3\nf 1 \\\n3 \\\n4\n"));
  ASSERT_EQ(mesh.position.size(), 4u);
  EXPECT_EQ(mesh.position[0], Vec3(0, 0, 0));
  EXPECT_EQ(mesh.triangle, (std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {0, 2, 3}}));
  // Named by the line that a statement begins in, and each line once.
  expect_refused("j.obj", "v 0 0 0\nv 1 \\\n0\nv 2 2 2\n", "j.obj:2: expected 'v' and three finite numbers");
  expect_refused("j.obj", "v 0 0 \\\n0\nv 1 0\n", "j.obj:3: expected 'v' and three finite numbers, found 'v 1 0'");
}

TEST_F(ReadMesh, ReadsBinaryPlyOfEitherByteOrder) {
  const auto bytes = [](auto value, bool big) {
    std::string raw(sizeof value, '\0');
    std::memcpy(raw.data(), &value, sizeof value);
    if (big != (std::endian::native == std::endian::big)) std::reverse(raw.begin(), raw.end());
    return raw;
  };
  for (const bool big : {false, true}) {
    std::string text = std::string("ply\nformat binary_") + (big ? "big" : "little") +
                       "_endian 1.0\nelement vertex 3\nproperty float x\nproperty double y\nproperty short z\nproperty uchar red\nelement face 1\n"
                       "property list uchar uint vertex_indices\nend_header\n";
    for (int i = 0; i < 3; ++i) {
      text += bytes(0.5F * static_cast<float>(i), big) + bytes(1.0 / (3.0 + i), big) + bytes(static_cast<std::int16_t>(-300 * i), big) + bytes(std::uint8_t{7}, big);
    }
    text += bytes(std::uint8_t{3}, big) + bytes(std::uint32_t{2}, big) + bytes(std::uint32_t{0}, big) + bytes(std::uint32_t{1}, big);
    const Mesh mesh = read_mesh(file("e.ply", text));
    EXPECT_EQ(mesh.position, (std::vector<Vec3>{{0.0, 1.0 / 3.0, 0.0}, {0.5, 0.25, -300.0}, {1.0, 0.2, -600.0}})) << big;
    EXPECT_EQ(mesh.triangle, (std::vector<std::array<std::uint32_t, 3>>{{2, 0, 1}})) << big;
    text.pop_back();
    expect_refused("e.ply", text, "expected a number for every property, found the end of the file");
  }
}

TEST_F(ReadMesh, CutsFacesWithCornersThatPointInwardsIntoWhatTheyHold) {
  // An L of 3 unit squares that begins at each of its corners, either way round, and one with a corner in the middle of a side.
  const std::vector<Vec3> outline{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}};
  std::string vertices;
  for (const Vec3& x : outline) vertices += "v " + std::to_string(x.x()) + ' ' + std::to_string(x.y()) + " 0\n";
  for (const bool all : {false, true}) {
    for (std::size_t first = 0; first < outline.size(); ++first) {
      for (const bool reversed : {false, true}) {
        std::string face = "f";
        std::size_t corners = 0;
        for (std::size_t k = 0; k < outline.size(); ++k) {
          const std::size_t at = (first + (reversed ? outline.size() - k : k)) % outline.size();
          if (!all && at == 1) continue;  // (1, 0) lies on a side
          face += ' ' + std::to_string(at + 1);
          ++corners;
        }
        const Mesh mesh = read_mesh(file("l.obj", vertices + face + '\n'));
        EXPECT_EQ(mesh.triangle.size(), corners - 2);
        double area = 0.0, absolute = 0.0;
        for (const auto& t : mesh.triangle) {
          const double own = 0.5 * (mesh.position[t[1]] - mesh.position[t[0]]).cross(mesh.position[t[2]] - mesh.position[t[0]]).z();
          area += own;
          absolute += std::abs(own);
        }
        EXPECT_DOUBLE_EQ(area, reversed ? -3.0 : 3.0) << face;
        EXPECT_DOUBLE_EQ(absolute, 3.0) << face;  // no triangle runs the other way, so none lies outside
      }
    }
  }
}

TEST_F(ReadMesh, RefusesMeshesBeyondTheRangeOfNumbers) {
  const auto triangle = [](const std::string& side, const std::string& stray) {
    return "v 0 0 0\nv " + side + " 0 0\nv 0 " + side + " 0\nv " + stray + " 0 0\nf 1 2 3\n";
  };
  expect_refused("a.obj", triangle("-1e51", "0"), "a.obj: expected coordinates up to 1e50 m in size, found 1e+51 m");
  expect_refused("a.obj", triangle("1e-51", "1"), "a.obj: expected a mesh whose longest side is at least 1e-50 m, found 1e-51 m");
  for (const char* side : {"1e50", "1e-50"}) {
    EXPECT_EQ(read_mesh(file("a.obj", triangle(side, "1e60"))).triangle.size(), 1u) << side;
  }
}

TEST_F(ReadMesh, SaysWhereAFileIsNotAMesh) {
  expect_refused("a.obj", "v 0 0\n", "a.obj:1: expected 'v' and three finite numbers, found 'v 0 0'");
  expect_refused("a.obj", "v 0 0 0\nf 1 2 3\n", "a.obj:2: expected 'f' and numbers of vertices above it");
  expect_refused("a.obj", "v 0 0 nan\n", "three finite numbers");
  expect_refused("a.obj", "v 0 0 0\n", "expected a mesh with faces, found none");
  expect_refused("a.stl", "solid\n", "expected a mesh in a file .obj or .ply, found '.stl'");
  expect_refused("a.ply", "plie\n", "a.ply:1: expected a file that begins with 'ply'");
  expect_refused("a.ply", "ply\nformat binary_middle_endian 1.0\n", "expected ascii, binary_little_endian or binary_big_endian");
  const std::string head = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
  expect_refused("a.ply", head + "end_header\n1 2\n", "expected a finite number for every property, found the end of the file");
  expect_refused("a.ply", head + "element face 1\nproperty list uchar int vertex_indices\nend_header\n1 2 3\n3 0 1 2\n",
                 "expected faces of the vertices before them, found vertex 1");
  for (const std::string number : {"1e+38", "-2"}) {
    expect_refused("a.ply", head + "element face 1\nproperty list uchar double vertex_indices\nend_header\n1 2 3\n3 0 " + number + " 2\n", "found vertex " + number);
  }
  EXPECT_THROW((void)read_mesh(folder_ / "absent.obj"), Error);
}

}  // namespace
}  // namespace supple::io
