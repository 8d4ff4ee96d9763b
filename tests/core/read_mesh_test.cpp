#include "supple/core/io/read_mesh.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include <unistd.h>

#include "supple/core/error.h"
#include "supple/core/io/mesh_files.h"

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
  fs::path folder_ = fs::temp_directory_path() / ("supple_read_mesh_" + std::to_string(getpid()));
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

TEST_F(ReadMesh, SaysWhereAFileIsNotAMesh) {
  expect_refused("a.obj", "v 0 0\n", "a.obj:1: expected 'v' and three finite numbers, found 'v 0 0'");
  expect_refused("a.obj", "v 0 0 0\nf 1 2 3\n", "a.obj:2: expected 'f' and numbers of vertices above it");
  expect_refused("a.obj", "v 0 0 nan\n", "three finite numbers");
  expect_refused("a.obj", "v 0 0 0\n", "expected a mesh with faces, found none");
  expect_refused("a.stl", "solid\n", "expected a mesh in a file .obj or .ply, found '.stl'");
  expect_refused("a.ply", "plie\n", "a.ply:1: expected a file that begins with 'ply'");
  expect_refused("a.ply", "ply\nformat binary_big_endian 1.0\n", "expected ascii or binary_little_endian");
  const std::string head = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
  expect_refused("a.ply", head + "end_header\n1 2\n", "expected a finite number for every property, found the end of the file");
  expect_refused("a.ply", head + "element face 1\nproperty list uchar int vertex_indices\nend_header\n1 2 3\n3 0 1 2\n",
                 "expected faces of the vertices before them, found vertex 1");
  EXPECT_THROW((void)read_mesh(folder_ / "absent.obj"), Error);
}

}  // namespace
}  // namespace supple::io
