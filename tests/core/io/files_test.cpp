#include <gtest/gtest.h>
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <limits>
#include <string>
#include <utility>

#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/io/mesh_files.h"
#include "supple/core/io/usd_file.h"
#include "supple/core/io/vtk_files.h"
#include "support/broken_calls.h"
#include "support/temp_folder.h"

namespace {

using namespace supple;
namespace fs = std::filesystem;

/// An empty folder that goes with the test.
class Files : public testing::Test {
 protected:
  Files() : folder_(temp_folder() / testing::UnitTest::GetInstance()->current_test_info()->name()) {
    fs::create_directories(folder_);
  }
  ~Files() override { fs::remove_all(folder_); }

  [[nodiscard]] fs::path path(const char* name) const { return folder_ / name; }
  [[nodiscard]] std::size_t file_count() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator{}));
  }
  [[nodiscard]] static std::string text_of(const fs::path& path) {
    const auto bytes = io::read_file(path, 1 << 20);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  template <class Call>
  static void expect_error(ErrorKind kind, const std::string& part, const Call& call) {
    try {
      call();
      FAIL() << part;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), kind);
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  }

 private:
  fs::path folder_;
};

TEST_F(Files, AreWrittenWholeAndReplaced) {
  io::write_atomically(path("a.txt"), std::string_view("first"));
  io::write_atomically(path("a.txt"), std::string_view("second"));
  EXPECT_EQ(text_of(path("a.txt")), "second");
  EXPECT_EQ(file_count(), 1U);
}

TEST_F(Files, ThatCannotBeWrittenLeaveNothing) {
  io::write_atomically(path("file"), std::string_view("x"));
  const fs::path below = path("file") / "child.txt";
  expect_error(ErrorKind::Io, below.string() + ": cannot be written: Not a directory",
               [&] { io::write_atomically(below, std::string_view("y")); });
  // A folder of the target's name: the temporary file is complete, the rename fails, and nothing is left.
  fs::create_directories(path("folder") / "inside");
  expect_error(ErrorKind::Io, "folder: cannot be written",
               [&] { io::write_atomically(path("folder"), std::string_view("y")); });
  EXPECT_EQ(file_count(), 2U);
  EXPECT_EQ(text_of(path("file")), "x");
}

TEST_F(Files, ThatAreAbsentOrTooLargeAreNamed) {
  expect_error(ErrorKind::Io, "absent: cannot be read: No such file",
               [&] { static_cast<void>(io::read_file(path("absent"), 10)); });
  expect_error(ErrorKind::Io, "cannot be read: Is a directory",
               [&] { static_cast<void>(io::read_file(path("."), 10)); });
  io::write_atomically(path("large"), std::string_view("12345678901"));
  expect_error(ErrorKind::Io, "lagre: cannot be read: No such file or directory; did you mean 'large'?", [&] { static_cast<void>(io::read_file(path("lagre"), 10)); });
  expect_error(ErrorKind::Io, "No such file or directory; there is no folder '" + path("below").string() + "'", [&] { static_cast<void>(io::read_file(path("below") / "large", 10)); });
  expect_error(ErrorKind::Limit, "expected at most 10 bytes, found 11",
               [&] { static_cast<void>(io::read_file(path("large"), 10)); });
  EXPECT_EQ(io::read_file(path("large"), 11).size(), 11U);
}

TEST_F(Files, StartsAreReadOfFilesThatMayBeAbsentAlone) {
  std::array<std::byte, 4> start{};
  EXPECT_EQ(io::read_start_if_there(path("absent"), start), 0U);
  io::write_atomically(path("short"), std::string_view("abc"));
  EXPECT_EQ(io::read_start_if_there(path("short"), start), 3U);
  EXPECT_EQ(io::read_start_if_there(path("short") / "below", start), 0U);
  // A folder opens and cannot be read, as a file on a failing disk.
  expect_error(ErrorKind::Io, "Is a directory", [&] { static_cast<void>(io::read_start_if_there(path("."), start)); });
}

TEST_F(Files, ThatAreReadAreRegularOnes) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  fs::create_symlink("/dev/zero", path("device"));
  std::array<std::byte, 8> start{};
  for (const auto& [name, found] : {std::pair{"pipe", "expected a regular file, found a pipe"}, {"device", "expected a regular file, found a device or a socket"}}) {
    expect_error(ErrorKind::Io, found, [&] { (void)io::read_file(path(name), 100); });
    expect_error(ErrorKind::Io, found, [&] { (void)io::read_start(path(name), start); });
    expect_error(ErrorKind::Io, found, [&] { (void)io::read_start_if_there(path(name), start); });
  }
}

TEST_F(Files, FoldersAreMadeOrRefused) {
  io::make_writable_folder(path("a") / "b");
  EXPECT_TRUE(fs::is_directory(path("a") / "b"));
  io::make_writable_folder(path("a") / "b");
  EXPECT_TRUE(fs::is_empty(path("a") / "b"));
  io::write_atomically(path("file"), std::string_view("x"));
  expect_error(ErrorKind::Io, "Not a directory", [&] { io::make_writable_folder(path("file") / "b"); });
  expect_error(ErrorKind::Io, "file", [&] { io::make_writable_folder(path("file")); });
}

TEST_F(Files, OfMeshesAreBinaryPly) {
  Mesh mesh;
  mesh.position = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 8.0 + 1e-9)};
  mesh.normal.assign(3, Vec3::UnitZ());
  mesh.triangle = {{0, 1, 2}};
  mesh.columns = {{"contact pressure", {1.5, 2.5, 3.5}}};
  io::write_ply(path("m.ply"), mesh);
  const std::string text = text_of(path("m.ply"));
  const std::string header =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n"
      "property float nx\nproperty float ny\nproperty float nz\nproperty float contact_pressure\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n";
  ASSERT_EQ(text.substr(0, header.size()), header);
  constexpr std::size_t kVertex = 3 * 8 + 4 * 4;
  ASSERT_EQ(text.size(), header.size() + 3 * kVertex + 13);
  const auto number = [&](auto value, std::size_t vertex, std::size_t offset) {
    std::memcpy(&value, text.data() + header.size() + vertex * kVertex + offset, sizeof value);
    return value;
  };
  EXPECT_EQ(number(0.0, 2, 16), 8.0 + 1e-9);
  EXPECT_EQ(number(0.0F, 1, 32), 1.0F);
  EXPECT_EQ(number(0.0F, 2, 36), 3.5F);
  EXPECT_EQ(text[header.size() + 3 * kVertex], 3);
  std::int32_t last = 0;
  std::memcpy(&last, text.data() + text.size() - 4, 4);
  EXPECT_EQ(last, 2);
}

TEST_F(Files, OfTablesReadBackWithTheSameBits) {
  const std::vector<double> x{0.1, -1.0 / 3.0, 6.02214076e23, 5e-324};
  const std::vector<double> y{1.0, 2.0, 3.0, 4.0};
  const std::vector<io::TableColumn> columns{{"x_m", x}, {"y_m", y}, {"z_m", x}};
  io::write_csv(path("t.csv"), columns);
  EXPECT_EQ(text_of(path("t.csv")).substr(0, 12), "x_m,y_m,z_m\n");
  const std::vector<Vec3> points = io::read_points_csv(path("t.csv"));
  ASSERT_EQ(points.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(points[i], Vec3(x[i], y[i], x[i]));
}

TEST_F(Files, OfPointsMayHaveHeadersCommentsAndAnySeparator) {
  io::write_atomically(path("p.csv"), std::string_view("\xEF\xBB\xBF# made by hand\r\nx, y, z\r\n1, 2,3\r\n\n"
                                                       "  4 5\t6 # the second\n+7;8;9e0"));
  const std::vector<Vec3> points = io::read_points_csv(path("p.csv"));
  EXPECT_EQ(points, (std::vector<Vec3>{Vec3(1, 2, 3), Vec3(4, 5, 6), Vec3(7, 8, 9)}));
}

TEST_F(Files, OfMorePointsThanAreTakenAreRefusedAtTheFirstBeyond) {
  io::write_atomically(path("p.csv"), std::string_view("1,2,3\n4,5,6\n7,8,9\nno number\n"));
  expect_error(ErrorKind::Scene, "p.csv:3", [&] { static_cast<void>(io::read_points_csv(path("p.csv"), 2)); });
  io::write_atomically(path("q.csv"), std::string_view("1,2,3\n4,5,6\n"));
  EXPECT_EQ(io::read_points_csv(path("q.csv"), 2).size(), 2U);
}

TEST_F(Files, ThatAreBeingWrittenAreRemovedWithoutUnwinding) {
  io::AtomicFile whole(path("whole"));
  whole.commit();
  io::AtomicFile file(path("part"));
  file.append(std::string_view("half"));
  const auto left = [&] { return std::distance(std::filesystem::directory_iterator(path("whole").parent_path()), {}); };
  const auto before = left();
  const std::filesystem::path folder = path("folder");
  const io::OpenTemporary open_folder(folder.c_str()), open_inside((folder / "inside").c_str());
  std::filesystem::create_directory(folder);
  io::write_atomically(folder / "inside", std::string_view("half"));
  io::remove_open_temporaries();
  EXPECT_EQ(left(), before - 1);
  EXPECT_TRUE(std::filesystem::exists(path("whole")));
}

TEST_F(Files, OfPointsHaveTheirColumnsInOrder) {
  for (const char* head : {"x,y,z", "X; Y; Z", "x y z", "\"x\",\"y\",\"z\"", "x [m], y [m], z [m]", "x_m,y_m,z_m", "east,north,up", "Points:0,Points:1,Points:2", "x,y"}) {
    io::write_atomically(path("p.csv"), std::string(head) + "\n1,2,3\n");
    EXPECT_EQ(io::read_points_csv(path("p.csv")), std::vector<Vec3>{Vec3(1, 2, 3)}) << head;
  }
  for (const char* head : {"z,y,x", "Y; X; Z", "z y x", "\"y\",\"x\",\"z\"", "x [m], z [m], y [m]", "y_m,x_m,z_m"}) {
    io::write_atomically(path("p.csv"), std::string(head) + "\n1,2,3\n");
    expect_error(ErrorKind::Scene, "p.csv:1: expected the columns x, y, z in this order, found '", [&] { (void)io::read_points_csv(path("p.csv")); });
  }
}

TEST_F(Files, OfPointsNameEveryLineThatIsNotThreeNumbers) {
  io::write_atomically(path("p.csv"), std::string_view("1,2,3\n1,2\n1,2,3,4\n1,,3\nx,y,z\n1,nan,3\n1,2,inf\n4,5,6\n"));
  try {
    static_cast<void>(io::read_points_csv(path("p.csv")));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Scene);
    ASSERT_EQ(error.faults().size(), 6U);
    EXPECT_EQ(error.faults()[0].message(), path("p.csv").string() + ":2: expected three finite numbers, found '1,2'");
    EXPECT_EQ(error.faults()[5].place, path("p.csv").string() + ":7");
  }
  io::write_atomically(path("p.csv"), std::string_view("1e50,-1e50,1e-300\n1,2,-1e51\n"));
  try {
    static_cast<void>(io::read_points_csv(path("p.csv")));
    FAIL();
  } catch (const Error& error) {
    ASSERT_EQ(error.faults().size(), 1U);
    EXPECT_EQ(error.faults()[0].message(), path("p.csv").string() + ":2: expected three numbers up to 1e50 in size, found '1,2,-1e51'");
  }
  expect_error(ErrorKind::Io, "none.csv", [&] { static_cast<void>(io::read_points_csv(path("none.csv"))); });
}

TEST_F(Files, ThatAreNotCommittedLeaveNothing) {
  {
    io::AtomicFile file(path("a.txt"));
    file.append(std::string(200000, 'x'));
    EXPECT_EQ(file_count(), 1U);  // under another name
    EXPECT_FALSE(fs::exists(path("a.txt")));
  }
  EXPECT_EQ(file_count(), 0U);
  io::AtomicFile file(path("a.txt"));
  std::string expected;
  for (const std::size_t length : {3U, 70000U, 1U, 65536U, 0U, 9U}) {
    expected += std::string(length, static_cast<char>('a' + length % 26));
    file.append(std::string(length, static_cast<char>('a' + length % 26)));
  }
  file.commit();
  EXPECT_EQ(text_of(path("a.txt")), expected);
  EXPECT_EQ(file_count(), 1U);
}

Mesh tetrahedron(double size) {
  Mesh mesh;
  mesh.position = {Vec3::Zero(), size * Vec3::UnitX(), size * Vec3::UnitY(), size * Vec3::UnitZ()};
  mesh.triangle = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  mesh.normal.assign(4, Vec3::UnitX());
  return mesh;
}

TEST_F(Files, OfMeshesAsObjCountVerticesFromOne) {
  io::write_obj(path("m.obj"), tetrahedron(0.1));
  EXPECT_EQ(text_of(path("m.obj")),
            "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nvn 1 0 0\nvn 1 0 0\nvn 1 0 0\nvn 1 0 0\n"
            "f 1//1 3//3 2//2\nf 1//1 2//2 4//4\nf 1//1 4//4 3//3\nf 2//2 3//3 4//4\n");
  io::write_obj(path("far.obj"), tetrahedron(8.0 + 1e-9));
  EXPECT_NE(text_of(path("far.obj")).find("v 8.000000001 0 0\n"), std::string::npos);
}

io::PointSet three_points() {
  io::PointSet points;
  points.position = {Vec3(1, 2, 3), Vec3(0.1, -0.2, 1e-300), Vec3(4, 5, 6)};
  points.line = {{0, 2}};
  points.add("mass_kg") = {1.0, 2.0, 1.0 / 3.0};
  points.add("spin <1/s>", {"a", "b"}) = {1, 2, 3, 4, 5, 6};
  return points;
}

TEST_F(Files, OfPointsAsVtpKeepEveryBitAtTheOffsetsTheyState) {
  const io::PointSet points = three_points();
  io::write_vtp(path("p.vtp"), points);
  const std::string text = text_of(path("p.vtp"));
  const std::size_t raw = text.find("encoding=\"raw\">\n_") + 17;
  const auto array = [&](const std::string& name) {
    const std::size_t tag = text.find("Name=\"" + name + '"');
    const std::size_t offset = std::stoul(text.substr(text.find("offset=\"", tag) + 8));
    std::uint64_t bytes = 0;
    std::memcpy(&bytes, text.data() + raw + offset, sizeof bytes);
    return text.substr(raw + offset + sizeof bytes, bytes);
  };
  const auto bits = [](const auto& values) {
    return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
  };
  EXPECT_EQ(array("mass_kg"), bits(points.data[0].values));
  EXPECT_EQ(array("spin &lt;1/s>"), bits(points.data[1].values));
  EXPECT_EQ(array("position_m"), bits(points.position));
  EXPECT_NE(text.find("NumberOfPoints=\"3\" NumberOfVerts=\"3\" NumberOfLines=\"1\""), std::string::npos);
  const std::size_t lines = text.find("<Lines>");
  const std::size_t offset = std::stoul(text.substr(text.find("offset=\"", lines) + 8));
  EXPECT_EQ(text.substr(raw + offset + 8, 16), bits(std::vector<std::int64_t>{0, 2}));
  EXPECT_TRUE(text.ends_with("\n  </AppendedData>\n</VTKFile>\n"));
}

TEST_F(Files, OfPointsAsTablesNameEveryComponent) {
  io::write_points_csv(path("p.csv"), three_points());
  EXPECT_EQ(text_of(path("p.csv")), "x_m,y_m,z_m,mass_kg,a,b\n1,2,3,1,1,2\n0.1,-0.2,1e-300,2,3,4\n"
                                    "4,5,6,0.3333333333333333,5,6\n");
  io::write_vtp(path("none.vtp"), {});
  io::write_points_csv(path("none.csv"), {});
  EXPECT_EQ(text_of(path("none.csv")), "x_m,y_m,z_m\n");
}

TEST_F(Files, OfSequencesNameTimesAndFiles) {
  const std::vector<io::TimedFile> files{{0.0, "particles/a.0001.vtp"}, {0.125, "particles/a & b.vtp"}, {0.25, "a\"<\n"}};
  io::write_pvd(path("a.pvd"), files);
  const std::string text = text_of(path("a.pvd"));
  EXPECT_NE(text.find("<DataSet timestep=\"0\" part=\"0\" file=\"particles/a.0001.vtp\"/>"), std::string::npos);
  EXPECT_NE(text.find("<DataSet timestep=\"0.125\" part=\"0\" file=\"particles/a &amp; b.vtp\"/>"), std::string::npos);
  EXPECT_NE(text.find("file=\"a&quot;&lt;&#10;\"/>"), std::string::npos);
}

TEST_F(Files, OfAnimationsOfManyObjectsNeedFewAtATime) {
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  rlimit few = before;
  few.rlim_cur = 64;
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &few), 0);
  Mesh mesh;
  mesh.position = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)};
  mesh.normal.assign(3, Vec3::UnitZ());
  mesh.triangle = {{0, 1, 2}};
  std::vector<io::UsdObject> objects(100, {.name = "leaf"});
  const std::vector<const Mesh*> meshes(objects.size(), &mesh);
  EXPECT_NO_THROW({
    io::UsdAnimation animation(path("many.usda"), 24.0, objects);
    animation.add_frame(1, meshes, {});
    animation.finish();
  });
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
  const std::string text = text_of(path("many.usda"));
  std::size_t count = 0;
  for (std::size_t at = 0; (at = text.find("def Mesh", at)) != std::string::npos; ++at) ++count;
  EXPECT_EQ(count, objects.size());
}

TEST_F(Files, OfAnimationsKeepWhatStaysByItsFirstAndLastFrame) {
  const std::vector<io::UsdObject> objects{{.name = "a.b"}, {.name = "a-b"}};
  {
    io::UsdAnimation animation(path("a.usda"), 24.0, objects);
    const Mesh still = tetrahedron(1.0), none;
    Mesh moving = tetrahedron(1.0);
    for (int frame = 1; frame <= 4; ++frame) {
      if (frame == 3) moving.columns.push_back({.name = "contact", .values = {0.0, 1.0, 0.0, 0.5}});
      if (frame == 4) moving = tetrahedron(2.0);
      animation.add_frame(frame, std::array<const Mesh*, 2>{&moving, frame == 2 ? &none : &still});
    }
    EXPECT_EQ(file_count(), 0U);  // until it is whole
    animation.finish();
  }
  EXPECT_EQ(file_count(), 1U);
  const std::string text = text_of(path("a.usda"));
  const std::size_t first = text.find("def Mesh \"a_b\""), second = text.find("def Mesh \"a_b_\"");
  ASSERT_NE(first, std::string::npos);
  ASSERT_NE(second, std::string::npos);
  const auto samples = [&](std::size_t from, const std::string& attribute) {
    const std::size_t begin = text.find(attribute + ".timeSamples = {\n", from);
    std::string block = text.substr(begin, text.find('}', begin) - begin);
    std::vector<int> frames;
    for (std::size_t at = block.find("\n            "); at != std::string::npos; at = block.find("\n            ", at + 1)) {
      frames.push_back(std::stoi(block.substr(at)));
    }
    return frames;
  };
  EXPECT_EQ(samples(first, "points"), (std::vector<int>{1, 3, 4}));
  EXPECT_EQ(samples(first, "faceVertexIndices"), (std::vector<int>{1}));
  EXPECT_EQ(samples(first, "primvars:contact"), (std::vector<int>{1, 2, 3, 4}));
  EXPECT_EQ(samples(second, "points"), (std::vector<int>{1, 2, 3}));
  EXPECT_EQ(samples(second, "visibility"), (std::vector<int>{1, 2, 3}));
  EXPECT_NE(text.find("startTimeCode = 1"), std::string::npos);
  EXPECT_NE(text.find("endTimeCode = 4"), std::string::npos);
}

/// Runs `body` in a process of its own, which ends with what it returns.
template <class Body>
int exit_code_of(const Body& body) {
  const pid_t child = ::fork();
  if (child == 0) {
    int code = 1;
    try {
      code = body();
    } catch (const std::exception& error) {
      std::fprintf(stderr, "%s\n", error.what());
    }
    ::_exit(code);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/// A triangle that moves, over three frames.
void write_animation(const fs::path& file) {
  const std::array objects = {io::UsdObject{.name = "triangle", .colour = Vec3(1, 0, 0), .roughness = 0.5}};
  io::UsdAnimation animation(file, 24.0, objects);
  for (int frame = 1; frame <= 3; ++frame) {
    Mesh mesh;
    mesh.position = {Vec3(0.1 * frame, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)};
    mesh.normal.assign(3, Vec3::UnitZ());
    mesh.triangle = {{0, 1, 2}};
    const std::array meshes = {static_cast<const Mesh*>(&mesh)};
    animation.add_frame(frame, meshes, {});
  }
  animation.finish();
}

TEST_F(Files, AreWholeWhereSignalsBreakCallsOff) {
  write_animation(path("plain.usda"));
  constexpr int kNoFilter = 77;
  const int code = exit_code_of([&] {
    if (!test::break_off_calls()) return kNoFilter;
    write_animation(path("broken.usda"));
    const std::string text(200000, 'x');
    io::write_atomically(path("long.txt"), std::string_view(text));
    io::make_writable_folder(path("folder"));
    std::array<std::byte, 300> start{};
    const bool same = text_of(path("long.txt")) == text && io::read_start(path("long.txt"), start) == start.size();
    return same ? 0 : 1;
  });
  EXPECT_NE(code, kNoFilter) << "the kernel lets no process filter its system calls, so this cannot be tried";
  EXPECT_EQ(code, 0);
  EXPECT_EQ(text_of(path("broken.usda")), text_of(path("plain.usda")));
  EXPECT_EQ(file_count(), 4U);
}

TEST_F(Files, NeverGetTheNumbersOfStandardStreams) {
  const int code = exit_code_of([&] {
    for (const int number : {0, 1, 2}) ::close(number);
    const io::Descriptor descriptor = io::open_file(path("direct.txt"), O_WRONLY | O_CREAT);
    io::AtomicFile file(path("a.txt"));
    file.append("of the file");
    for (const int number : {0, 1, 2}) {
      if (::write(number, "of a library", 12) != -1) return 2;
    }
    file.commit();
    return descriptor.get() > 2 && ::fcntl(descriptor.get(), F_GETFD) == FD_CLOEXEC ? 0 : 3;
  });
  EXPECT_EQ(code, 0);
  EXPECT_EQ(text_of(path("a.txt")), "of the file");
  EXPECT_EQ(text_of(path("direct.txt")), "");
}

TEST_F(Files, LeaveClosedStandardStreamsToTheSystem) {
  const int code = exit_code_of([&] {
    ::close(0);
    ::close(2);
    if (io::occupy_standard_descriptors() != std::array{true, false, true}) return 2;
    if (io::occupy_standard_descriptors() != std::array{false, false, false}) return 3;
    char byte = 0;
    return ::read(0, &byte, 1) == 0 && ::write(2, "text", 4) == -1 ? 0 : 4;  // nothing to read, and what is printed fails
  });
  EXPECT_EQ(code, 0);
}

}  // namespace
