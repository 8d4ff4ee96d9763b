// Solids that stand still, and objects whose particles are bodies of their own.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>

#include "supple/core/error.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

Simulation make(const std::string& text, const fs::path& folder = ".", SimulationOptions options = {}) {
  return Simulation(parse_scene(text, "test.yaml", folder), options);
}

void run(Simulation& simulation, int frames) {
  while (simulation.frame() < frames) simulation.step_frame();
}

std::string ball_over(const std::string& below) {
  return R"(
schema: 1
duration: 6 s
frame_rate: 10
gravity: [0, 0, -9.81]
)" + below + R"(
objects:
  - name: drop
    particles: {arrange: single, at: [0.02, 0.01, 0.25], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
    contact: {modulus: 5e3}
    medium: {linear: 6, angular: 6}
)";
}

double rest_height(Simulation simulation) {
  run(simulation, 61);
  EXPECT_EQ(simulation.contacts().summary.size(), 1u);
  EXPECT_NEAR(simulation.contact_forces()[0].z(), 0.2 * 9.81, 1e-5 * 0.2 * 9.81);
  EXPECT_LT(simulation.audits().momentum_error, 1e-10);
  return simulation.state().particles.position[0].z();
}

TEST(Obstacles, CarryABallAsTheGroundDoes) {
  const fs::path folder = temp_folder() / "obstacles";
  fs::create_directories(folder);
  {
    std::ofstream file(folder / "flat.csv");
    file << "x,y,z\n";
    for (const double y : {-1.0, 0.0, 1.0, 2.0}) {
      for (const double x : {-1.0, 0.0, 1.0}) file << x << ',' << y << ",0\n";
    }
  }
  const double on_ground = rest_height(make(ball_over("ground: {height: 0, modulus: 1e6}")));
  EXPECT_NEAR(rest_height(make(ball_over("obstacles: [{name: floor, shape: plane, normal: [0, 0, 3], modulus: 1e6}]"))), on_ground, 1e-9);
  EXPECT_NEAR(rest_height(make(ball_over(
                  "obstacles: [{name: floor, shape: box, at: [0, 0, -0.5], half_sizes: [0.5, 2, 2], turn_axis: [0, 3, 0], turn_deg: 90, modulus: 1e6}]"))),
              on_ground, 1e-7);
  EXPECT_NEAR(rest_height(make(ball_over("obstacles: [{name: floor, shape: heights, file: flat.csv, modulus: 1e6}]"), folder)),
              on_ground, 1e-7);
}

TEST(Obstacles, CarryFlatAndStraightBodiesAtRest) {
  // Faces nearly parallel to the ground: nowhere nearest, so a rule that asks where they are must not lose the contact.
  for (const char* shape : {"{shape: box, half_sizes: [0.15, 0.15, 0.1], kernel: {radius: 0.1}}",
                            "{shape: disc, radius: 0.15, kernel: {radius: 0.1}}",
                            "{shape: segment, half_length: 0.2, kernel: {radius: 0.1}}"}) {
    Simulation simulation = make(std::string(R"(
schema: 1
duration: 2 s
frame_rate: 20
accuracy: 5e-3
gravity: [0, 0, -9.81]
contact: {error: 0.01}
objects:
  - name: a
    particles: {at: [0, 0, 0.2], mass: 1}
    skeleton: [)") + shape + R"(]
    contact: {modulus: 1e5, friction: 0.5, dissipation: 2}
    medium: {linear: 2, angular: 2}
ground: {}
)");
    while (simulation.frame() < 40) simulation.step_frame();
    EXPECT_LT(simulation.state().particles.velocity[0].norm(), 2e-3) << shape;
    ASSERT_EQ(simulation.contacts().summary.size(), 1u) << shape;
    EXPECT_NEAR(simulation.contact_forces()[0].norm(), 9.81, 0.05 * 9.81) << shape;
    EXPECT_LT(simulation.audits().energy_error, 2e-2) << shape;
    EXPECT_LE(simulation.audits().energy_returned, 1e-12) << shape;
  }
}

TEST(Obstacles, GiveATurningBoxNoEnergy) {
  Simulation simulation = make(R"(
schema: 1
duration: 0.6 s
frame_rate: 100
gravity: [0, 0, -9.81]
objects:
  - name: box
    particles: {at: [0.3, 0, 0.6], spin: [0, 4, 0], velocity: [0, 0, 1]}
    skeleton: [{shape: box, half_sizes: [0.2, 0.2, 0.2], kernel: {radius: 0.1}}]
    contact: {dissipation: 1}
ground: {}
)");
  // Of a cube of half side h with rounded edges, about 2/3 m h^2.
  EXPECT_NEAR(simulation.model().particles.inertia[0].x(), 2.0 / 3.0 * 0.24 * 0.24, 0.06 * 2.0 / 3.0 * 0.24 * 0.24);
  while (simulation.frame() < 61) simulation.step_frame();
  EXPECT_GT(simulation.state().ledger.dissipated, 0.1);
  EXPECT_LE(simulation.audits().energy_returned, 1e-12);
  EXPECT_LT(simulation.audits().energy_error, 2e-2);
}

/// A slab of 4 x 4 m with its upper face at z = 0, as squares; `open` leaves one side out.
void write_slab(const fs::path& file, bool open, double thickness = 1.0, double half_side = 2.0) {
  std::ofstream out(file);
  for (const double z : {-thickness, 0.0}) {
    for (const double y : {-half_side, half_side}) {
      for (const double x : {-half_side, half_side}) out << "v " << x << ' ' << y << ' ' << z << '\n';
    }
  }
  out << "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\n";
  if (!open) out << "f 2 4 8 6\n";
}

TEST(Obstacles, OfMeshesCarryABallAsTheGroundDoes) {
  const fs::path folder = temp_folder() / "obstacles";
  fs::create_directories(folder);
  write_slab(folder / "slab.obj", false);
  const double on_ground = rest_height(make(ball_over("ground: {height: 0, modulus: 1e6}")));
  EXPECT_NEAR(rest_height(make(ball_over("obstacles: [{name: floor, shape: mesh, file: slab.obj, modulus: 1e6}]"), folder)),
              on_ground, 1e-7);
  // Turned about x by a quarter, the face at y = 2 is up.
  EXPECT_NEAR(rest_height(make(ball_over("obstacles: [{name: floor, shape: mesh, file: slab.obj, turn_axis: [1, 0, 0], "
                                         "turn_deg: 90, at: [0, -0.5, -2], modulus: 1e6}]"),
                               folder)),
              on_ground, 1e-7);
}

/// An octahedron with each edge cut in `cuts`, its vertices on a sphere.
void write_ball(const fs::path& file, double radius, int cuts) {
  std::ofstream out(file);
  out.precision(17);
  int vertices = 0;
  std::string faces;
  for (int octant = 0; octant < 8; ++octant) {
    const Vec3 side((octant & 1) != 0 ? -radius : radius, (octant & 2) != 0 ? -radius : radius, (octant & 4) != 0 ? -radius : radius);
    const bool mirrored = side.prod() < 0.0;
    const auto at = [&](int i, int j) { return vertices + 1 + j * (cuts + 1) - j * (j - 1) / 2 + i; };
    for (int j = 0; j <= cuts; ++j) {
      for (int i = 0; i + j <= cuts; ++i) {
        const auto face = [&](int a, int b, int c) {
          faces += "f " + std::to_string(a) + ' ' + std::to_string(mirrored ? c : b) + ' ' + std::to_string(mirrored ? b : c) + '\n';
        };
        if (i + j < cuts) face(at(i, j), at(i + 1, j), at(i, j + 1));
        if (i + j < cuts - 1) face(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
        const Vec3 x = Vec3(i, j, cuts - i - j).normalized().cwiseProduct(side);
        out << "v " << x.x() << ' ' << x.y() << ' ' << x.z() << '\n';
      }
    }
    vertices += (cuts + 1) * (cuts + 2) / 2;
  }
  out << faces;
}

TEST(Obstacles, OfMeshesPressAsTheBallTheyShowWithFinerFaces) {
  // An octahedron with faces cut finely, on a sphere of 0.3 m; pressures rise by the same 1e5 Pa/m in both balls.
  const fs::path folder = temp_folder() / "obstacles";
  fs::create_directories(folder);
  // Closed form: the circle where both are at pressure p, summed over p by Simpson's rule.
  const double rise = 1e5, radius = 0.1, other = 0.3, distance = 0.37;
  const double most = (radius + other - distance) / (2.0 / rise);
  const auto circle = [&](double p) {
    const double a = radius - p / rise, b = other - p / rise, z = (distance * distance + a * a - b * b) / (2.0 * distance);
    return std::numbers::pi * (a * a - z * z);
  };
  double exact = 0.0;
  for (int k = 0; k < 100; ++k) {
    const double p = most * k / 100.0, h = most / 100.0;
    exact += h / 6.0 * (circle(p) + 4.0 * circle(p + 0.5 * h) + circle(p + h));
  }
  double error[2];
  for (const int finer : {0, 1}) {
    write_ball(folder / "sphere.obj", other, 12 << finer);
    Simulation simulation = make(R"(
schema: 1
duration: 1 s
contact: {error: 1e-4}
obstacles: [{name: ball, shape: mesh, file: sphere.obj, modulus: 2e4, slope: 5}]
objects:
  - name: drop
    particles: {arrange: single, at: [0, 0, 0.37], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: 2e4}
)", folder);
    ASSERT_EQ(simulation.contacts().summary.size(), 1u);
    error[finer] = 1.0 - simulation.contacts().summary[0].force.z() / exact;
  }
  // Faces with edges of e lie e^2 / 12 R below the sphere in the mean, and twice that over the depth of 0.03 m is missing. At the octahedron's
  // corner, which is up, e is 0.3 m sqrt(2) over the cuts.
  const double edge = 0.3 * std::numbers::sqrt2 / 12.0;
  EXPECT_NEAR(error[0], 2.0 * edge * edge / (12.0 * other) / 0.03, 0.5 * error[0]);
  EXPECT_NEAR(error[0] / error[1], 4.0, 0.8);
}

TEST(Obstacles, RefuseMeshesThatAreOpenAndNameAnEdge) {
  const fs::path folder = temp_folder() / "obstacles";
  fs::create_directories(folder);
  write_slab(folder / "open.obj", true);
  const auto message = [&](const std::string& keys) -> std::string {
    try {
      make(ball_over("obstacles: [{name: floor, shape: mesh, " + keys + "}]"), folder);
    } catch (const Error& error) {
      return error.what();
    }
    return "no fault";
  };
  // Where the file has it, wherever it is put.
  EXPECT_EQ(message("file: open.obj, at: [3, 4, 5]"),
            "test.yaml:6:46: obstacles.floor.file: expected a closed surface, every edge between two triangles, found one triangle at the edge between "
            "vertices 2 and 4, counted from 1, at (2, -2, -1) and (2, 2, -1); 3 other edges are open, too; close its holes, so that it has an inside");
  EXPECT_NE(message("file: absent.obj").find("absent.obj"), std::string::npos);
}

TEST(Obstacles, OfThinMeshesCarryABallAsTheGroundDoes) {
  const fs::path folder = temp_folder() / "obstacles";
  fs::create_directories(folder);
  write_slab(folder / "sheet.obj", false, 0.04);
  // Below the ball the sheet is as stiff as the ground down to its middle, far deeper than the ball sinks in.
  const double on_ground = rest_height(make(ball_over("ground: {height: 0, modulus: 1e6}")));
  EXPECT_NEAR(rest_height(make(ball_over("obstacles: [{name: floor, shape: mesh, file: sheet.obj, modulus: 1e6}]"), folder)), on_ground, 1e-7);
}

// A block of 1 m with a shelf 10 mm thick that stands out by 0.3 m.
TEST(Obstacles, OfABlockWithAThinShelfCarryABallOnIt) {
  const fs::path folder = temp_folder() / "obstacles";
  fs::create_directories(folder);
  {
    std::ofstream out(folder / "shelf.obj");
    const double outline[][2] = {{-0.5, 0}, {0.5, 0}, {0.5, 0.6}, {0.8, 0.6}, {0.8, 0.61}, {0.5, 0.61}, {0.5, 1}, {-0.5, 1}};
    for (const double y : {0.5, -0.5}) {
      for (const auto& [x, z] : outline) out << "v " << x << ' ' << y << ' ' << z << '\n';
    }
    out << "f 1 8 7 6 5 4 3 2\nf 9 10 11 12 13 14 15 16\n";  // with corners that point inwards
    for (int k = 1; k <= 8; ++k) out << "f " << k << ' ' << k % 8 + 1 << ' ' << k % 8 + 9 << ' ' << k + 8 << '\n';
  }
  const auto height = [&](const std::string& below) {
    Simulation simulation = make(R"(
schema: 1
duration: 2 s
gravity: [0, 0, -9.81]
contact: {error: 1e-3}
objects:
  - name: ball
    particles: {arrange: single, at: [0.65, 0, 0.706], mass: 0.05}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: 1e4}
    medium: {linear: 20, angular: 20}
)" + below, folder);
    EXPECT_TRUE(simulation.warnings().empty());
    run(simulation, 48);
    EXPECT_EQ(simulation.contacts().summary.size(), 1u);
    return simulation.state().particles.position[0].z();
  };
  // Both are solved to 1e-3 of a force that rises with the square of the depth, 5.7 mm, and what is under half of the shelf's thickness is pressed
  // into by a twentieth of that.
  const double on_plane = height("obstacles: [{name: block, shape: plane, at: [0, 0, 0.61]}]");
  EXPECT_LT(on_plane, 0.61 + 0.1 - 0.004);
  EXPECT_NEAR(height("obstacles: [{name: block, shape: mesh, file: shelf.obj}]"), on_plane, 1e-5);
}

TEST(Obstacles, OfMeshesWithACavityHoldABallInIt) {
  const fs::path folder = temp_folder() / "obstacles";
  fs::create_directories(folder);
  {
    std::ofstream out(folder / "container.obj");
    for (const auto& [half, low, high] : {std::array{0.7, -0.2, 1.2}, std::array{0.5, 0.0, 1.0}}) {
      for (const double z : {low, high}) {
        for (const double y : {-half, half}) {
          for (const double x : {-half, half}) out << "v " << x << ' ' << y << ' ' << z << '\n';
        }
      }
    }
    out << "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
           "f 10 12 11 9\nf 15 16 14 13\nf 13 14 10 9\nf 12 16 15 11\nf 11 15 13 9\nf 14 16 12 10\n";
  }
  const double on_ground = rest_height(make(ball_over("ground: {height: 0, modulus: 1e6}")));
  Simulation inside = make(ball_over("obstacles: [{name: hollow, shape: mesh, file: container.obj, modulus: 1e6}]"), folder);
  EXPECT_TRUE(inside.warnings().empty());
  EXPECT_NEAR(rest_height(std::move(inside)), on_ground, 1e-7);
}

TEST(Obstacles, OfMeshesAreToldWhereTheyAreMended) {
  const fs::path folder = temp_folder() / "obstacles";
  fs::create_directories(folder);
  write_slab(folder / "slab.obj", false);
  std::string text;
  {
    std::ifstream in(folder / "slab.obj");
    text.assign(std::istreambuf_iterator<char>(in), {});
  }
  text.replace(text.find("f 1 5 7 3"), 9, "f 1 3 7 5");
  std::ofstream(folder / "turned.obj") << text;
  Simulation turned = make(ball_over("obstacles: [{name: floor, shape: mesh, file: turned.obj, modulus: 1e6}]"), folder);
  ASSERT_EQ(turned.warnings().size(), 1u);
  EXPECT_EQ(turned.warnings()[0], "obstacles.floor.file: 2 triangles are reversed, as most of the triangles that share their edges are oriented the other way");
  EXPECT_NEAR(rest_height(std::move(turned)), rest_height(make(ball_over("ground: {height: 0, modulus: 1e6}"))), 1e-7);
}

// A ball whose tip is on the far side of a thin sheet, or beyond it, of which few of its samples or none lie in the sheet.
TEST(Obstacles, OfThinMeshesAreMetHoweverDeep) {
  const fs::path folder = temp_folder() / "obstacles";
  fs::create_directories(folder);
  constexpr double kRadius = 0.1, kStiffness = 1e5;
  // As of a plane under each face: pi k d^2 (3 R - 2 d) / 3 at the depth d.
  const auto force = [](double d) { return d > 0.0 ? std::numbers::pi * kStiffness * d * d * (3.0 * kRadius - 2.0 * d) / 3.0 : 0.0; };
  struct Case {
    double thickness, depth;
  };
  for (const auto& [thickness, depth] : {Case{0.02, 0.002}, Case{0.02, 0.02}, Case{0.02, 0.05}, Case{0.004, 0.004}, Case{0.004, 0.012}}) {
    write_slab(folder / "thin.obj", false, thickness, 0.4);
    char ball[512];
    std::snprintf(ball, sizeof ball, R"(
schema: 1
duration: 0.1 s
objects:
  - name: ball
    particles: {arrange: single, at: [0.05, 0.03, %g], mass: 1}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 10}}]
    contact: {modulus: 1e4}
obstacles: [{name: sheet, shape: mesh, file: thin.obj, modulus: 1e9}]
contact: {error: 1e-3}
)", kRadius - depth);
    Simulation simulation = make(ball, folder);
    ASSERT_EQ(simulation.contacts().summary.size(), 1u) << thickness << ' ' << depth;
    const auto& s = simulation.contacts().summary[0];
    // The ball's depth in the sheet, which is 1e5 times as stiff, is below 1e-6 m.
    EXPECT_NEAR(s.force.norm(), force(depth) - force(depth - thickness), 2e-3 * force(depth)) << thickness << ' ' << depth;
  }
}

/// A file of heights over [-1.6, 1.6]^2, every 0.1 m.
template <class Height>
void write_heights(const fs::path& file, const Height& height) {
  fs::create_directories(file.parent_path());
  std::ofstream out(file);
  out.precision(17);
  out << "x,y,z\n";
  for (int j = -16; j <= 16; ++j) {
    for (int i = -16; i <= 16; ++i) out << 0.1 * i << ',' << 0.1 * j << ',' << height(0.1 * i, 0.1 * j) << '\n';
  }
}

TEST(Obstacles, OfHeightsThatRiseEvenlyAreThePlane) {
  const fs::path folder = temp_folder() / "obstacles";
  write_heights(folder / "slope.csv", [](double x, double y) { return 0.24 * x - 0.32 * y; });
  const std::string exact = "contact: {error: 1e-8}\n";
  Simulation heights = make(ball_over(exact + "obstacles: [{name: slope, shape: heights, file: slope.csv, modulus: 1e4}]"), folder);
  Simulation plane = make(ball_over(exact + "obstacles: [{name: slope, shape: plane, normal: [-0.24, 0.32, 1], modulus: 1e4}]"));
  run(heights, 7);
  run(plane, 7);
  const Vec3 at = plane.state().particles.position[0];
  EXPECT_GT(heights.contacts().summary.size(), 0u);
  EXPECT_GT((at - Vec3(0.02, 0.01, 0.25)).norm(), 0.1);  // down the slope
  EXPECT_LT((heights.state().particles.position[0] - at).norm(), 1e-6);
}

/// What a ball of radius 0.1 m, pressed 5 mm into z = 0.2 x, meets at a place.
std::string ball_on_ramp(double x, const std::string& obstacle) {
  const double z = 0.2 * x + 0.095 * std::sqrt(1.04);
  return R"(
schema: 1
duration: 1
contact: {error: 1e-6}
objects:
  - name: ball
    particles: {arrange: single, at: [)" + std::to_string(x) + ", 0.03, " + std::to_string(z) + R"(], mass: 0.1}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: 1e4}
obstacles: [)" + obstacle + "]\n";
}

TEST(Obstacles, OfHeightsArePlanesUpToTheirBorders) {
  const fs::path folder = temp_folder() / "obstacles";
  write_heights(folder / "ramp.csv", [](double x, double) { return 0.2 * x; });
  for (const double x : {-1.55, -1.0, 0.0, 0.333, 1.2, 1.5, 1.53}) {
    Simulation plane = make(ball_on_ramp(x, "{name: ramp, shape: plane, normal: [-0.2, 0, 1]}"));
    Simulation heights = make(ball_on_ramp(x, "{name: ramp, shape: heights, file: ramp.csv}"), folder);
    ASSERT_EQ(plane.contacts().summary.size(), 1u);
    ASSERT_EQ(heights.contacts().summary.size(), 1u) << x;
    const Vec3 expected = plane.contact_forces()[0];
    EXPECT_LT((heights.contact_forces()[0] - expected).norm(), 2e-6 * expected.norm()) << x;
    EXPECT_NEAR(heights.contacts().summary[0].largest_overlap, plane.contacts().summary[0].largest_overlap, 1e-6) << x;
  }
  // Nothing is there beyond the last heights.
  Simulation beyond = make(ball_on_ramp(1.75, "{name: ramp, shape: heights, file: ramp.csv}"), folder);
  EXPECT_TRUE(beyond.contacts().summary.empty());
}

TEST(Obstacles, ThatAreFlushHoldABallOnce) {
  const auto over = [](const std::string& solids) {
    return make(R"(
schema: 1
duration: 0.5
gravity: [0, 0, -9.81]
contact: {error: 0.01}
objects:
  - name: ball
    particles: {arrange: single, at: [0.05, 0.03, 0.095], mass: 0.1}
    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]
    contact: {modulus: 1e4, dissipation: 1}
)" + solids);
  };
  const std::string slab = "{name: slab, shape: box, at: [0, 0, -0.2], half_sizes: [0.5, 0.5, 0.2]}";
  const std::string right = "{name: right, shape: box, at: [0.6, 0, -0.2], half_sizes: [0.61, 0.5, 0.2]}";
  Simulation alone = over("ground: true\n");
  const double force = alone.contact_forces().at(0).z();
  alone.advance_to(13);
  for (const std::string& solids : {"ground: true\nobstacles: [" + slab + "]\n", "obstacles: [" + slab + ", " + right + "]\n", "ground: true\nobstacles: [" + right + ", " + slab + "]\n"}) {
    Simulation flush = over(solids);
    ASSERT_EQ(flush.contacts().summary.size(), 1u) << solids;
    EXPECT_NEAR(flush.contact_forces()[0].z(), force, 0.02 * force) << solids;
    flush.advance_to(13);
    EXPECT_NEAR(flush.state().particles.position[0].z(), alone.state().particles.position[0].z(), 1e-4) << solids;
    EXPECT_LT(flush.audits().energy_error, 0.02) << solids;
  }
}

TEST(Obstacles, OfHeightsHoldABallInTheirHollow) {
  const fs::path folder = temp_folder() / "obstacles";
  write_heights(folder / "hollow.csv", [](double x, double y) { return 0.4 * ((x - 0.1) * (x - 0.1) + (y + 0.2) * (y + 0.2)) - 0.1; });
  Simulation simulation = make(ball_over("obstacles: [{name: hollow, shape: heights, file: hollow.csv, modulus: 1e6}]"), folder);
  run(simulation, 61);
  EXPECT_LT((simulation.state().particles.position[0] - Vec3(0.1, -0.2, simulation.state().particles.position[0].z())).norm(), 1e-3);
  ASSERT_EQ(simulation.contacts().summary.size(), 1u);
  EXPECT_NEAR(simulation.contact_forces()[0].z(), 0.2 * 9.81, 1e-3 * 0.2 * 9.81);
}

TEST(Obstacles, RefuseHeightsThatAreNoGrid) {
  const fs::path folder = temp_folder() / "obstacles";
  fs::create_directories(folder);
  std::ofstream(folder / "holes.csv") << "0,0,0\n1,0,0\n0,1,0\n";
  try {
    make(ball_over("obstacles: [{name: hills, shape: heights, file: holes.csv}]"), folder);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("obstacles.hills.file: expected points of a regular grid"), std::string::npos)
        << error.what();
  }
}

TEST(Obstacles, AreNamedInPairs) {
  const std::string floor = "obstacles: [{name: floor, shape: plane}]\n";
  Simulation through = make(ball_over(floor + "pairs: [{objects: [drop, floor], collide: false}]"));
  run(through, 11);
  EXPECT_LT(through.state().particles.position[0].z(), -1.0);
  const Simulation slippery = make(ball_over(floor + "pairs: [{objects: [floor, drop], friction: 0.25}]"));
  ASSERT_EQ(slippery.model().rules.overrides.size(), 1u);
  EXPECT_EQ(slippery.model().rules.overrides[0].material.friction, 0.25);
}

/// Five balls in a row, the first thrown at the others.
std::string row_of_balls(bool separate) {
  return R"(
schema: 1
duration: 1 s
frame_rate: 20
objects:
  - name: balls
    particles: {arrange: line, count: 5, spacing: 0.5, mass: 0.1, velocity: [1, 0, 0], disorder: 0.02}
    separate: )" + std::string(separate ? "true" : "false") + R"(
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
    contact: {modulus: 5e3}
  - name: wall
    particles: {arrange: single, at: [1.6, 0, 0], mass: 5}
    skeleton: [{shape: box, half_sizes: [0.1, 0.5, 0.5], kernel: {type: wyvill, radius: 0.2}}]
    contact: {modulus: 5e3}
)";
}

TEST(SeparateBodies, TouchEachOther) {
  Simulation simulation = make(row_of_balls(true));
  EXPECT_EQ(simulation.bodies().size(), 6u);
  EXPECT_EQ(simulation.bodies()[2].name, "balls.3");
  const core::Motion start = core::measure_motion(simulation.model().particles, simulation.state().particles);
  bool among_balls = false;
  while (simulation.frame() < 21) {
    simulation.step_frame();
    for (const auto& s : simulation.contacts().summary) among_balls = among_balls || s.bodies.b < 5;
  }
  EXPECT_TRUE(among_balls);
  const core::Motion end = core::measure_motion(simulation.model().particles, simulation.state().particles);
  EXPECT_LE((end.momentum - start.momentum).norm(), 1e-12 * start.momentum_scale);
  EXPECT_LT(simulation.state().particles.velocity[4].x(), 0.5);  // the last one was stopped by the wall
  EXPECT_EQ(simulation.meshes().size(), 2u);
  EXPECT_EQ(simulation.state().record.objects[0].largest_deformation, 0.0);  // none of them was deformed, though the row was

  const Simulation one = make(row_of_balls(false));
  EXPECT_EQ(one.bodies().size(), 2u);
}

TEST(Obstacles, OfPrimitivesCarryABallAsAnObjectThatIsHeldDoes) {
  // Of two shapes, askew: a body that nothing moves has the same field in its place.
  const std::string skeleton =
      "skeleton: [{shape: box, half_sizes: [0.3, 0.3, 0.05], kernel: {radius: 0.2}}, {shape: point, at: [0, 0, 0.1], kernel: {radius: 0.3}}]";
  const std::string falls = "schema: 1\nduration: 3 s\nframe_rate: 10\ngravity: [0, 0, -9.81]\ncontact: {error: 1e-6}\ntime_step: {substeps: 64}\n";
  const std::string ball =
      "objects:\n  - name: drop\n    particles: {at: [0.02, 0.01, 0.5], mass: 0.2}\n    skeleton: [{shape: point, kernel: {radius: 0.3}}]\n"
      "    contact: {modulus: 5e3, friction: 0.4, dissipation: 1}\n    medium: {linear: 6, angular: 6}\n";
  Simulation led = make(falls + ball + "obstacles: [{name: rock, shape: implicit, modulus: 2e4, friction: 0.4, turn_axis: [0, 1, 0], turn_deg: 30, at: [0.1, 0, 0], " +
                        skeleton + "}]\n");
  Simulation held = make(falls + ball +
                         "  - name: rock\n    particles: {at: [0.1, 0, 0], axis: [0.5, 0, 0.86602540378443865]}\n    pins: [{particle: 0}]\n"
                         "    contact: {modulus: 2e4, friction: 0.4}\n    " + skeleton + "\n");
  run(led, 8);
  run(held, 8);
  EXPECT_GT(led.state().particles.position[0].x(), 0.05);  // it slides down
  EXPECT_LT((led.state().particles.position[0] - held.state().particles.position[0]).norm(), 1e-7);
  EXPECT_LT(led.audits().momentum_error, 1e-11);
}

TEST(Obstacles, OfPrimitivesAreSeenThoughThinnerThanSamplesOfTheBodyLieApart) {
  // The spike has a support of 2 cm and stands between the samples of the bar, which for itself would have them 4.5 cm apart.
  Simulation simulation = make(R"(
schema: 1
duration: 0.15 s
frame_rate: 20
gravity: [0, 0, -9.81]
contact: {error: 1e-3}
obstacles: [{name: spike, shape: implicit, modulus: 1e6, at: [0.013, 0, 0], skeleton: [{shape: point, kernel: {radius: 0.02}}]}]
objects:
  - name: bar
    particles: {at: [0, 0, 0.163], mass: 0.01}
    pins: [{particle: 0, position: false}]
    skeleton: [{shape: point, at: [-0.1, 0, 0], kernel: {radius: 0.3}}, {shape: point, at: [0.1, 0, 0], kernel: {radius: 0.3}}]
    contact: {modulus: 1e5, dissipation: 1}
)");
  run(simulation, 4);
  EXPECT_GT(simulation.state().particles.position[0].z(), 0.15);  // with nothing below it would be at 0.05
}

// What stops it has a lever about the origin, and it neither turns nor is there anything else: the scale is not that of its spin.
TEST(Obstacles, ThatStopASingleBallLeaveTheBalanceOfAngularMomentum) {
  Simulation simulation = make(R"(
schema: 1
duration: 0.5 s
frame_rate: 20
gravity: [0, 0, -9.81]
contact: {error: 1e-2}
obstacles: [{name: table, shape: box, half_sizes: [0.5, 0.5, 0.05]}]
objects:
  - name: ball
    particles: {at: [0.03, 0.02, 0.3], velocity: [0, 0, -3], mass: 0.2}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.3}}]
    contact: {modulus: 2e5}
)");
  run(simulation, 11);
  EXPECT_GT(simulation.state().particles.position[0].z(), 0.3);
  EXPECT_LT(simulation.audits().angular_momentum_error, 1e-12);
  EXPECT_LT(simulation.audits().momentum_error, 1e-12);
}

// Six that move make 15 pairs, and each of them two with what stands still.
TEST(SeparateBodies, MayBeginInOnePlace) {
  const fs::path folder = temp_folder() / "obstacles";
  fs::create_directories(folder);
  std::ofstream(folder / "twice.csv") << "0,0,0\n0,0,0\n";
  const std::string head = "schema: 1\nduration: 1\nframe_rate: 10\nobjects:\n  - name: twins\n    skeleton: [{shape: point, kernel: {radius: 0.1}}]\n";
  for (const char* rest : {"    particles: {arrange: file, file: twice.csv}\n    separate: true\n",
                           "    particles: {arrange: file, file: twice.csv, velocity: [1, 0, 0]}\n    separate: true\n    contact: {modulus: 1e4}\n",
                           "    particles: {arrange: file, file: twice.csv, inertia_radius: 0.05}\n"}) {
    Simulation simulation = make(head + rest, folder);
    EXPECT_DOUBLE_EQ(simulation.model().smallest_length, simulation.model().objects[0].iso_radius) << rest;
    simulation.advance_to(3);
    EXPECT_TRUE(simulation.state().particles.position[1].allFinite()) << rest;
  }
}

TEST(SeparateBodies, AreCountedAsPairsOneByOne) {
  Simulation simulation = make(row_of_balls(true) + "ground: {height: -1}\nobstacles: [{name: end, shape: plane, at: [3, 0, 0], normal: [-1, 0, 0]}]\n");
  simulation.step();
  const StageProfile found = simulation.profile()[static_cast<std::size_t>(Stage::FindContacts)];
  ASSERT_GT(found.calls, 0u);
  EXPECT_EQ(found.present, 27 * found.calls);
}

TEST(SeparateBodies, HaveTheSameBitsForAnyThreadsAndWithoutSkips) {
  const auto hash_of = [](SimulationOptions options) {
    Simulation simulation = make(row_of_balls(true), ".", options);
    run(simulation, 15);
    return simulation.state_hash();
  };
  const std::uint64_t one = hash_of({.threads = 1});
  EXPECT_EQ(hash_of({.threads = 3}), one);
  EXPECT_EQ(hash_of({.threads = 1, .skip = false}), one);
}

}  // namespace
}  // namespace supple::scenes
