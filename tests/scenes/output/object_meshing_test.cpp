/// `objects[].meshing`: cells and errors of their own, alone and where objects touch.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <string>
#include <tuple>

#include "implicit/bodies.h"
#include "model/warnings.h"
#include "output/meshes/search_files.h"
#include "supple/core/error.h"
#include "supple/core/mesh.h"
#include "supple/implicit/creases.h"
#include "supple/scenes/query.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

/// A coin beside a house or on it, and a tower that touches nothing.
std::string scene_of(const std::string& coin, const std::string& output, const std::string& coin_at = "[3, 0, 0]") {
  const std::string body = ", mass: 1}\n    contact: {modulus: 1e4}\n    skeleton: [{shape: point, kernel: {radius: ";
  return "schema: 1\nduration: 1\nobjects:\n"
         "  - name: coin\n    particles: {at: " + coin_at + body + "0.5}}]\n    meshing: {" + coin + "}\n"
         "  - name: house\n    particles: {at: [0, 0, 0]" + body + "2}}]\n"
         "  - name: tower\n    particles: {at: [0, 6, 0]" + body + "2}}]\n"
         "output: {mesh: ply" + output + "}\n";
}

std::vector<Mesh> meshes_of(const std::string& text) { return Simulation(parse_scene(text, "test.yaml", ".")).meshes(); }

bool same(const Mesh& a, const Mesh& b) { return a.position == b.position && a.triangle == b.triangle; }

// Of two lone balls of radii R and r at iso 1/2: their surfaces lie at 0.454 R and 0.454 r.
constexpr const char* kTouching = "[1.0, 0, 0]";

TEST(ObjectMeshing, CellOfAnObjectThatTouchesNothingLeavesTheOthersAlone) {
  const std::vector<Mesh> own = meshes_of(scene_of("cell: 0.02", ", cell: 0.1"));
  const std::vector<Mesh> coarse = meshes_of(scene_of("", ", cell: 0.1")), fine = meshes_of(scene_of("", ", cell: 0.02"));
  ASSERT_GT(fine[0].triangle_count(), 4 * coarse[0].triangle_count());
  EXPECT_TRUE(same(own[0], fine[0]));
  EXPECT_TRUE(same(own[1], coarse[1]));
  EXPECT_TRUE(same(own[2], coarse[2]));
}

TEST(ObjectMeshing, SmallestCellHoldsForObjectsThatTouch) {
  const std::vector<Mesh> own = meshes_of(scene_of("cell: 0.05", ", cell: 0.1", kTouching));
  const std::vector<Mesh> coarse = meshes_of(scene_of("", ", cell: 0.1", kTouching));
  const std::vector<Mesh> fine = meshes_of(scene_of("", ", cell: 0.05", kTouching));
  for (const std::size_t k : {0u, 1u}) {
    EXPECT_TRUE(same(own[k], fine[k])) << k;
    EXPECT_FALSE(same(coarse[k], fine[k])) << k;
  }
  EXPECT_TRUE(same(own[2], coarse[2]));
  // A coarser wish of one of them does not count.
  const std::vector<Mesh> wished = meshes_of(scene_of("cell: 0.2", ", cell: 0.1", kTouching));
  EXPECT_TRUE(same(wished[0], coarse[0]) && same(wished[1], coarse[1]));
}

constexpr const char* kFoundOne = "output.meshing.search: pieces of surfaces between the nodes of the lattice, found and added to the meshes of all frames: 1";

TEST(ObjectMeshing, SearchFindsAnObjectBetweenTheNodesUnlessItIsOff) {
  const auto make = [](const std::string& search, const std::string& at) {
    return Simulation(parse_scene(scene_of("cell: 0.9", ", cell: 0.1, meshing: {" + search + '}', at), "test.yaml", "."));
  };
  const std::string between = "[3.1, 0.4, 0.4]";  // 0.7 m from the nearest node
  Simulation plain = make("search: false", between), searched = make("search: true", between), automatic = make("", between);
  const std::vector<Mesh> without = plain.meshes(), with = searched.meshes(), unasked = automatic.meshes();
  EXPECT_EQ(without[0].triangle_count(), 0u);
  EXPECT_GT(with[0].triangle_count(), 100u);
  for (const Vec3& x : with[0].position) EXPECT_NEAR((x - Vec3(3.1, 0.4, 0.4)).norm(), 0.5 * 0.454202019, 1e-6);
  EXPECT_TRUE(same(with[1], without[1]) && same(with[2], without[2]));
  for (std::size_t k = 0; k < 3; ++k) EXPECT_TRUE(same(unasked[k], with[k])) << k;
  ASSERT_EQ(plain.warnings().size(), 1u);
  EXPECT_NE(plain.warnings()[0].find("cells of 0.9 m may miss 'coin'"), std::string::npos) << plain.warnings()[0];
  ASSERT_EQ(searched.warnings().size(), 1u);
  EXPECT_EQ(searched.warnings()[0],
            std::string(kFoundOne) + "; undecided cells, where a piece may be missing: 0; meshes of bodies that bulge, which are not searched: 0");
  ASSERT_EQ(automatic.warnings().size(), 1u);
  EXPECT_EQ(automatic.warnings()[0], kFoundOne);
  EXPECT_EQ(automatic.searches().pieces, 1u);
  EXPECT_TRUE(automatic.searches().unsearched.empty() && plain.searches().empty());
}

TEST(ObjectMeshing, SearchFindsACoinInAHouseUnlessItIsOff) {
  // Stiff, smaller than a cell, and wholly inside: no node of the lattice is the coin's.
  const auto text_of = [](const std::string& search, const std::string& contact) {
    std::string text = scene_of("", ", cell: 0.4, meshing: {" + search + '}', "[0.35, 0.3, 0.38]");
    text.replace(text.find("{modulus: 1e4}"), 14, "{modulus: 1e6}");
    return text.replace(text.find("duration"), 0, contact);
  };
  const auto make = [&](const std::string& search, const std::string& contact = "") {
    return Simulation(parse_scene(text_of(search, contact), "test.yaml", "."));
  };
  Simulation plain = make("search: false"), searched = make("search: true"), bulging = make("search: true", "contact: {bulge: 0.4}\n");
  const std::vector<Mesh> without = plain.meshes(), with = searched.meshes();
  EXPECT_EQ(without[0].triangle_count(), 0u);
  ASSERT_GT(with[0].triangle_count(), 100u);
  EXPECT_EQ(with[1].triangle_count(), without[1].triangle_count() + with[0].triangle_count());
  EXPECT_TRUE(same(with[2], without[2]));
  ASSERT_FALSE(searched.warnings().empty());
  EXPECT_NE(searched.warnings().back().find("all frames: 1; undecided cells, where a piece may be missing: 0;"), std::string::npos) << searched.warnings().back();
  (void)bulging.meshes();
  EXPECT_NE(bulging.warnings().back().find("are not searched: 2"), std::string::npos) << bulging.warnings().back();
  Simulation automatic = make("");
  const std::vector<Mesh> unasked = automatic.meshes();
  EXPECT_EQ(automatic.warnings().back(), kFoundOne);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_TRUE(same(unasked[k], with[k])) << k;
}

/// One object of this skeleton and blend, and how it is meshed.
std::string lone(const std::string& particles, const std::string& skeleton, const std::string& output) {
  return "schema: 1\nduration: 1\nobjects:\n  - name: thing\n    particles: {" + particles + "}\n    skeleton: [" + skeleton + "]\n" +
         output;
}

TEST(ObjectMeshing, SearchIsLeftOutWhereItsSkeletonSaysThatItDecidesNothing) {
  const std::string row = "arrange: line, count: 3, spacing: 0.4", ball = "{shape: point, kernel: {radius: 0.5}}";
  const std::string bend = "{shape: curve, points: [[-0.25, -0.1, 0], [-0.1, 0.55, 0], [0.1, -0.55, 0], [0.25, 0.1, 0]], kernel: {radius: 0.28}}";
  for (const std::string& text : {lone(row, ball, "    blend: {rule: gradient}\n"), lone("at: [0, 0, 0]", bend + ", " + ball, "")}) {
    const auto make = [&](const std::string& search) {
      return Simulation(parse_scene(text + "output: {mesh: ply, cell: 0.05, meshing: {search: " + search + "}}\n", "test.yaml", "."));
    };
    Simulation automatic = make("auto"), off = make("false");
    ASSERT_GT(automatic.meshes()[0].triangle_count(), 100u);
    EXPECT_TRUE(same(automatic.meshes()[0], off.meshes()[0]));
    EXPECT_EQ(automatic.searches().undecided, 0u);
    EXPECT_EQ(automatic.searches().not_searched(Unsearched::Undecided), 1u);
    ASSERT_EQ(automatic.warnings().size(), 1u);
    EXPECT_EQ(automatic.warnings()[0], "output.meshing.search: meshes that auto does not search, as cells along blends by gradients or tight bends "
                                       "would stay undecided: 1");
    EXPECT_NE(explain(automatic).find("thing: not searched: cells along blends by gradients or tight bends would stay undecided"),
              std::string::npos) << explain(automatic);
    EXPECT_TRUE(off.warnings().empty());
    EXPECT_NE(explain(off).find("search for pieces between the nodes of the lattice: switched off in the scene"), std::string::npos);
  }
}

TEST(ObjectMeshing, SearchIsLeftOutWhereItWouldTakeFarLongerThanTheMesh) {
  const auto make = [](const std::string& cell, const std::string& meshing) {
    return Simulation(parse_scene(lone("arrange: grid, columns: 12, rows: 12, spacing: 0.15", "{shape: triangle, points: [[-0.06, -0.06, 0], [0.06, -0.06, 0], [0, 0.06, 0]], kernel: {radius: 0.3}}",
                                       "output: {mesh: ply, cell: " + cell + ", meshing: {" + meshing + "}}\n"), "test.yaml", "."));
  };
  Simulation coarse = make("0.1", ""), off = make("0.1", "search: false"), fine = make("0.02", ""), other = make("0.1", "method: tetrahedra");
  EXPECT_TRUE(same(coarse.meshes()[0], off.meshes()[0]));
  EXPECT_EQ(coarse.searches().not_searched(Unsearched::Cost), 1u);
  EXPECT_EQ(coarse.searches().unsearched.at("thing"), (SearchCounts::Meshes{0, 0, 1, 0}));
  ASSERT_EQ(coarse.warnings().size(), 1u);
  EXPECT_EQ(coarse.warnings()[0], "output.meshing.search: meshes that auto does not search, as that would cost far more than meshing: 1");
  EXPECT_NE(explain(coarse).find(" x meshing; output.meshing.search: true searches it"), std::string::npos) << explain(coarse);
  (void)fine.meshes();
  EXPECT_TRUE(fine.searches().empty() && fine.warnings().empty());
  EXPECT_NE(explain(fine).find("thing: searched, estimated search cost: "), std::string::npos) << explain(fine);
  // The scene asks for another mesher, which needs no warning.
  (void)other.meshes();
  EXPECT_EQ(other.searches().not_searched(Unsearched::Mesher), 1u);
  EXPECT_TRUE(other.warnings().empty());
}

TEST(ObjectMeshing, SearchOfBodiesThatTouchInManyPlacesIsLeftOutUnlessAsked) {
  const auto make = [](const std::string& search) {
    return Simulation(parse_scene(lone("arrange: line, count: 12, spacing: 0.4, mass: 1", "{shape: square, half_size: 0.05, kernel: {radius: 0.5}}, {shape: segment, half_length: 0.05, kernel: {radius: 0.5}}",
                                       "    separate: true\n    contact: {modulus: 1e4}\noutput: {mesh: ply, cell: 0.3, meshing: {search: " + search + "}}\n"),
                                  "test.yaml", "."));
  };
  Simulation automatic = make("auto"), asked = make("true"), off = make("false");
  EXPECT_TRUE(same(automatic.meshes()[0], off.meshes()[0]));
  EXPECT_EQ(automatic.searches().not_searched(Unsearched::Cost), 12u);
  (void)asked.meshes();
  EXPECT_TRUE(asked.searches().unsearched.empty());
}

TEST(ObjectMeshing, ErrorIsOfTheObjectOrOfAllThatTouchIt) {
  const std::string cubes = ", cell: 0.1, meshing: {method: cubes";
  for (const std::string at : {"[3, 0, 0]", kTouching}) {
    const std::vector<Mesh> own = meshes_of(scene_of("error: 2 mm", cubes + '}', at));
    const std::vector<Mesh> none = meshes_of(scene_of("", cubes + '}', at)), all = meshes_of(scene_of("", cubes + ", error: 2 mm}", at));
    ASSERT_FALSE(same(none[0], all[0]) || same(none[1], all[1]));
    EXPECT_TRUE(same(own[0], all[0]));
    EXPECT_TRUE(same(own[1], at == kTouching ? all[1] : none[1]));
    EXPECT_TRUE(same(own[2], none[2]));
  }
  const std::vector<Mesh> two = meshes_of(scene_of("error: 2 mm", cubes + ", error: 20 mm}", kTouching));
  const std::vector<Mesh> all = meshes_of(scene_of("", cubes + ", error: 2 mm}", kTouching));
  EXPECT_TRUE(same(two[0], all[0]) && same(two[1], all[1]));
}

/// Two balls that unite without blending, askew; their surfaces meet on a circle.
std::string creased(const std::string& meshing) {
  return "schema: 1\nduration: 1\nobjects:\n  - name: a\n    particles: {arrange: line, count: 2, spacing: 0.6, inertia_radius: .1, axis: [1, .3, .2], "
         "angle_deg: 17}\n    blend: {rule: graph}\n    skeleton: [{shape: point, kernel: {radius: 1}}]\noutput: {mesh: ply, meshing: {" + meshing + "}}\n";
}

TEST(ObjectMeshing, ErrorKeepsCreasesUnlessTheyAreNotAskedFor) {
  Simulation simulation(parse_scene(creased("error: 1 mm"), "test.yaml", "."));
  const Mesh mesh = simulation.meshes().front();
  const Vec3 a = simulation.state().particles.position[0], b = simulation.state().particles.position[1];
  const double radius = 0.454202019, apart = 0.5 * (b - a).norm(), rim = std::sqrt(radius * radius - apart * apart);
  const auto on_circle = [&](const Mesh& m) {
    return std::count_if(m.position.begin(), m.position.end(), [&](const Vec3& p) {
      const double along = (p - 0.5 * (a + b)).dot(b - a) / (2.0 * apart);
      return std::abs(along) < 1e-8 && std::abs((p - 0.5 * (a + b)).norm() - rim) < 1e-8;
    });
  };
  EXPECT_GT(on_circle(mesh), 20);
  double largest = 0.0;  // from the ball of the side where a centroid lies, as their surface does but next to the circle
  for (const auto& t : mesh.triangle) {
    const Vec3 c = (mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]) / 3.0;
    largest = std::max(largest, std::min(std::abs((c - a).norm() - radius), std::abs((c - b).norm() - radius)));
  }
  EXPECT_LE(largest, 1e-3);
  EXPECT_EQ(on_circle(meshes_of(creased("method: cubes, error: 5 mm")).front()), 0);
}

// Balls in disorder, with valleys that are steep for the cells.
TEST(ObjectMeshing, CellsThatKeepACreaseCutOffAreReported) {
  constexpr double kCell = 0.15;
  Simulation simulation(parse_scene("schema: 1\nduration: 1\nobjects:\n  - name: a\n    particles: {arrange: grid, columns: 5, rows: 5, layers: 3, spacing: 0.6, "
                                    "disorder: 0.3, inertia_radius: .1}\n    blend: {rule: graph}\n    skeleton: [{shape: point, kernel: {radius: 1}}]\n"
                                    "output: {mesh: ply, cell: 0.15, meshing: {method: auto, search: false}}\n",
                                    "test.yaml", "."));
  const Mesh mesh = simulation.meshes().front();
  std::vector<std::pair<implicit::Primitive, Vec3>> balls;
  for (const Vec3& at : simulation.state().particles.position) balls.emplace_back(implicit::testing::wyvill_point(1.0), at);
  implicit::testing::Body body = implicit::testing::body_of(balls);
  body.skeleton.blend.rule = implicit::BlendRule::Graph;
  body.place();
  implicit::MarchCounts counts;
  EXPECT_TRUE(same(mesh, implicit::march_creases(body.field, {.lattice = {.origin = Vec3::Zero(), .cell = kCell}}, Executor(2), &counts)));
  EXPECT_GT(counts.blunt_cells, 0u);
  EXPECT_EQ(simulation.searches().blunt, (std::map<std::string, std::uint64_t>{{"a", counts.blunt_cells}}));
}

TEST(ObjectMeshing, CellsThatKeepACreaseCutOffAreCounted) {
  const std::filesystem::path folder = temp_folder() / "blunt_cells";
  for (const int frame : {1, 2}) {
    SearchCounts counts;
    counts.blunt["pair"] = static_cast<std::uint64_t>(2 + frame);
    write_searches(folder, "pair", frame, counts);
  }
  const SearchCounts all = read_searches(folder, "pair", {}, 2);
  EXPECT_EQ(all.blunt, (std::map<std::string, std::uint64_t>{{"pair", 7}}));
  std::vector<std::string> warnings;
  for (int i = 0; i < 2; ++i) set_missed(MeshingDesc{}, all, warnings);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0], "output.meshing.method: cells whose crease is cut off, as triangles with vertices on it would intersect, in the meshes of all frames: 7 of 'pair'; "
                         "smaller cells resolve more of it");
  set_missed(MeshingDesc{}, {}, warnings);
  EXPECT_TRUE(warnings.empty());
  std::filesystem::remove_all(folder);
}

TEST(ObjectMeshing, BulgesHoldTheVolumeOfEachBodyOrAWarningTells) {
  // Two balls of radius 0.1 that lose a fiftieth of their volume to each other; meshes of 4 mm cells lose 1e-3 of it, with and without bulges.
  const auto meshed = [](const std::string& contact, const std::string& at) {
    const std::string ball = ", mass: 1}\n    contact: {modulus: 1e4}\n    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 10}}]\n";
    Simulation simulation(parse_scene("schema: 1\nduration: 1\nobjects:\n  - name: low\n    particles: {at: [0, 0, 0]" + ball + "  - name: high\n    particles: {at: " + at + ball +
                                          "contact: {error: 1e-6" + contact + "}\noutput: {mesh: ply, cell: 4 mm}\n",
                                      "test.yaml", "."));
    const std::vector<Mesh> meshes = simulation.meshes();
    (void)simulation.division();  // of the same state: counted once
    std::vector<std::string> told = simulation.warnings();
    std::erase_if(told, [](const std::string& warning) { return !warning.starts_with("contact.bulge_volume: "); });
    EXPECT_EQ(query_mesh(simulation, {}).find("\"held\"") == std::string::npos, told.empty());
    return std::tuple{inspect(meshes[0]).volume, told, simulation.searches().short_bulges};
  };
  const auto [whole, none, nothing] = meshed("", "[0, 0, 1]");
  const auto [cut, unasked, no_bulges] = meshed("", "[0, 0.02, 0.165]");
  const auto [held, quiet, enough] = meshed(", bulge_volume: true", "[0, 0.02, 0.165]");
  EXPECT_LT(cut, 0.985 * whole);
  EXPECT_NEAR(held, whole, 0.05 * (whole - cut));
  EXPECT_TRUE(quiet.empty() && enough.empty());
  const auto [narrow, told, lacking] = meshed(", bulge_volume: true, bulge_width: 0.15", "[0, 0.02, 0.165]");
  EXPECT_GT(narrow, cut);
  EXPECT_LT(narrow, whole - 0.5 * (whole - cut));
  ASSERT_EQ(told.size(), 2u);
  EXPECT_TRUE(told[0].starts_with("contact.bulge_volume: the bulge of 'high' around 'low' holds 0.")) << told[0];
  EXPECT_TRUE(told[0].ends_with(" of the displaced volume at t = 0 s, and 1 in all frames hold too little; 'bulge_width' and the reach of the fields beyond the surfaces "
                                "limit its height"))
      << told[0];
  const ShortBulges& low = lacking.at("low").at("high");
  EXPECT_EQ(low.count, 1u);
  EXPECT_NEAR(low.held, (narrow - cut) / (whole - cut), 0.05);
}

TEST(ObjectMeshing, BulgesThatHoldTooLittleAreToldOnceForAllFrames) {
  const std::filesystem::path folder = temp_folder() / "short_bulges";
  for (const int frame : {1, 2, 3}) {
    SearchCounts counts;
    counts.short_bulges["ball"]["ground"] = {.count = 2, .held = frame == 2 ? 0.5 : 0.75, .time = 0.1 * frame};
    write_searches(folder, "drop", frame, counts);
  }
  const SearchCounts all = read_searches(folder, "drop", {}, 3);
  const ShortBulges& read = all.short_bulges.at("ball").at("ground");
  EXPECT_EQ(read.count, 6u);
  EXPECT_EQ(read.held, 0.5);
  EXPECT_EQ(read.time, 0.2);
  std::vector<std::string> warnings;
  for (int i = 0; i < 2; ++i) set_missed(MeshingDesc{}, all, warnings);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].starts_with("contact.bulge_volume: the bulge of 'ball' around 'ground' holds 0.5 of the displaced volume at t = 0.2 s, and 6 in all frames"));
  set_missed(MeshingDesc{}, {}, warnings);
  EXPECT_TRUE(warnings.empty());
  // Grids alone say nothing of meshes that were made before.
  SearchCounts counts;
  counts.pieces = 3;
  write_searches(folder, "drop", 4, counts);
  counts = {};
  counts.short_bulges["ball"]["ground"] = {.count = 1, .held = 0.5, .time = 0.4};
  for (const std::size_t bulges : {1u, 0u}) {
    write_short_bulges(folder, "drop", 4, counts);
    const SearchCounts both = read_searches(folder, "drop", {4}, 4);
    EXPECT_EQ(both.pieces, 3u);
    EXPECT_EQ(both.short_bulges.size(), bulges);
    counts = {};
  }
  std::filesystem::remove_all(folder);
}

TEST(ObjectMeshing, StatedCellIsTheCoarsestThatAnErrorMayTake) {
  for (const std::string at : {"[3, 0, 0]", kTouching}) {
    const std::string cell = ", cell: 0.03, meshing: {method: cubes";
    const std::vector<Mesh> by_cell = meshes_of(scene_of("", cell + "}", at)), both = meshes_of(scene_of("", cell + ", error: 0.1}", at));
    const std::vector<Mesh> by_error = meshes_of(scene_of("", ", meshing: {method: cubes, error: 0.1}", at));
    for (const std::size_t k : {0u, 1u}) {
      EXPECT_TRUE(same(both[k], by_cell[k])) << at << k;
      EXPECT_LT(by_error[k].triangle_count(), by_cell[k].triangle_count()) << at << k;
    }
  }
}

TEST(ObjectMeshing, AutomaticCellIsByTheObjectsWithoutOne) {
  const Simulation both(parse_scene(scene_of("cell: 1 mm", ""), "test.yaml", "."));
  const Simulation alone(parse_scene(scene_of("", ""), "test.yaml", "."));
  const double fitting = both.model().objects[1].cell;
  EXPECT_EQ(both.cell(), fitting);
  EXPECT_EQ(both.model().objects[0].cell, 1e-3);
  EXPECT_NEAR(fitting, 4.0 * alone.cell(), 1e-12);  // four times as thick
}

TEST(ObjectMeshing, ChangesNoBitOfTheMotionAndIsExplained) {
  const Scene plain = parse_scene(scene_of("", ", cell: 0.1"), "test.yaml", "."), own = parse_scene(scene_of("cell: 0.05", ", cell: 0.1"), "test.yaml", ".");
  EXPECT_EQ(plain.content_hash, own.content_hash);
  EXPECT_NE(plain.picture_hash, own.picture_hash);
  Simulation simulation(own);
  const std::string text = explain(simulation);
  EXPECT_NE(text.find("surface lattice cell coin 0.05 m, house 0.1 m, tower 0.1 m; objects that touch use the smallest of theirs"),
            std::string::npos) << text;
}

TEST(ObjectMeshing, IsNamedWhereItCannotBe) {
  try {
    (void)meshes_of(scene_of("cell: 1e-12", ", cell: 0.1"));
    FAIL() << "such cells fit into no memory";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Limit);
    EXPECT_EQ(error.faults()[0].key, "objects.coin.meshing.cell");
    EXPECT_EQ(error.faults()[0].place, "test.yaml:8:21");
  }
}

// A contact in a plane of a lattice about the origin had triangles without area in it, and some that were turned over.
TEST(ObjectMeshing, BodiesInMirrorImageMeetInTrianglesWithAnArea) {
  const auto ball = [](const std::string& name, const std::string& x) {
    return "  - name: " + name + "\n    particles: {at: [" + x + ", 0, 0], mass: 1}\n    contact: {modulus: 1e4}\n"
           "    skeleton: [{shape: point, kernel: {radius: 0.5}}]\n";
  };
  constexpr double kCell = 0.02;
  const std::vector<Mesh> meshes = meshes_of("schema: 1\nduration: 1\nobjects:\n" + ball("left", "-0.2") + ball("right", "0.2") +
                                             "output: {mesh: ply, cell: 0.02}\n");
  for (std::size_t k = 0; k < 2; ++k) {
    const double outwards = k == 0 ? 1.0 : -1.0;
    std::size_t in_plane = 0;
    for (const auto& t : meshes[k].triangle) {
      const Vec3 &a = meshes[k].position[t[0]], &b = meshes[k].position[t[1]], &c = meshes[k].position[t[2]];
      const Vec3 area = 0.5 * (b - a).cross(c - a);
      EXPECT_GT(area.norm(), 1e-9 * kCell * kCell);
      if (std::max({std::abs(a.x()), std::abs(b.x()), std::abs(c.x())}) > 1e-9) continue;
      ++in_plane;
      EXPECT_GT(outwards * area.x(), 0.0);
    }
    EXPECT_GT(in_plane, 100u);
  }
}

}  // namespace
}  // namespace supple::scenes
