// What scenes say about pictures: cameras that move, columns for colours, files of several cameras.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "output/pictures/camera.h"
#include "supple/core/error.h"
#include "supple/render/image.h"
#include "supple/render/renderer.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "supple/scenes/simulation.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

Scene scene_with(const std::string& look, const std::string& rest) {
  return parse_scene(R"(
schema: 1
duration: 0.5 s
frame_rate: 4
objects:
  - name: chain
    particles: {arrange: line, count: 3, spacing: 0.2, velocity: [1, 0, 0], mass: 0.5}
    interactions: [{law: bond_frame, stretch: 50, rotation: 0.1}]
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.4}}]
    colour: [0.8, 0.2, 0.1]
    look: {)" + look + "}\n" + rest, "looks.yaml", ".");
}

constexpr const char* kOneCamera = "camera: {from: [0, -3, 1], look_at: [0, 0, 0]}\n"
                                   "output: {images: {size: [160, 120], samples: 4}}\n";

class Looks : public testing::Test {
 protected:
  Looks() : folder_(temp_folder() / ("looks_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()))) {
    fs::remove_all(folder_);
  }
  ~Looks() override { fs::remove_all(folder_); }

  render::Image first_picture(const Scene& scene, const std::string& name = "looks") {
    const RunResult done = run_scene(scene, {.folder = folder_, .frames = {1}, .threads = 1, .overwrite = true});
    EXPECT_EQ(done.outcome, "done") << done.reason;
    return render::read_png(folder_ / "frames" / (name + ".0001.png"));
  }
  fs::path folder_;
};

TEST(Camera, TurnsAboutWhatItLooksAt) {
  CameraDesc desc;
  desc.from = Vec3(0, -3, 1);
  desc.look_at = Vec3(0, 0, 0.5);
  desc.turntable = 2.0 * M_PI;
  EXPECT_LT((camera_at(desc, 0.25, 1.0).from - Vec3(3, 0, 1)).norm(), 1e-12);
  EXPECT_LT((camera_at(desc, 1.0, 1.0).from - *desc.from).norm(), 1e-12);
}

TEST(Camera, PassesItsKeysAndRestsAtBothEnds) {
  CameraDesc desc;
  desc.keys = {{.time = 1.0, .from = Vec3(0, -3, 0)}, {.time = 2.0, .from = Vec3(3, 0, 0)}, {.time = 4.0, .from = Vec3(0, 3, 1), .field_of_view = 1.0}};
  for (const CameraKeyDesc& key : desc.keys) EXPECT_LT((camera_at(desc, key.time, 5.0).from - key.from).norm(), 1e-12);
  EXPECT_EQ(camera_at(desc, 0.0, 5.0).from, desc.keys[0].from);
  EXPECT_EQ(camera_at(desc, 9.0, 5.0).field_of_view, 1.0);
  // Without corners: the slopes on both sides of a key agree.
  const double h = 1e-6;
  const Vec3 before = (camera_at(desc, 2.0, 5.0).from - camera_at(desc, 2.0 - h, 5.0).from) / h;
  const Vec3 after = (camera_at(desc, 2.0 + h, 5.0).from - camera_at(desc, 2.0, 5.0).from) / h;
  EXPECT_LT((before - after).norm(), 1e-4);
  EXPECT_LT((camera_at(desc, 1.0 + h, 5.0).from - desc.keys[0].from).norm() / h, 1e-4);
}

/// Where a point is in the picture, -1 to 1 in both directions.
Eigen::Vector2d seen_at(const render::Camera& camera, double aspect, const Vec3& p) {
  const Vec3 back = (camera.from - camera.look_at).normalized(), right = camera.up.cross(back).normalized(), up = back.cross(right);
  const Vec3 x = p - camera.from;
  const double scale = -1.0 / (x.dot(back) * std::tan(0.5 * camera.field_of_view));
  return {scale * x.dot(right) / aspect, scale * x.dot(up)};
}

TEST(Camera, WithoutAPlaceHoldsAllThatIsThereInFourFifthsOfThePicture) {
  Scene scene;
  scene.output.images = ImagesDesc{.size = {200, 100}};
  scene.cameras.resize(3);
  scene.cameras[1].look_at = Vec3(1, 2, 3);
  scene.cameras[2].field_of_view = 1.5;
  for (const Box& box : {Box{Vec3(-1, -2, 0), Vec3(1, 2, 0.5)}, Box{Vec3(-3, 0, 0), Vec3(3, 0.1, 0.1)}, Box{Vec3(1000, 0, 0), Vec3(1000.01, 0.02, 0.03)}}) {
    for (const CameraDesc& desc : placed_cameras(scene, box)) {
      const render::Camera camera = camera_at(desc, 0.0, 1.0);
      double most = 0.0;
      for (int corner = 0; corner < 8; ++corner) {
        const Vec3 p((corner & 1 ? box.upper : box.lower).x(), (corner & 2 ? box.upper : box.lower).y(), (corner & 4 ? box.upper : box.lower).z());
        EXPECT_GT((camera.from - p).dot(camera.from - camera.look_at), 0.0);
        most = std::max(most, seen_at(camera, 2.0, p).cwiseAbs().maxCoeff());
      }
      EXPECT_NEAR(most, 0.8, 1e-6);  // 1e-16 of 1 km over 1 cm, and some
    }
  }
  EXPECT_EQ(placed_cameras(scene, Box{Vec3(-1, -2, 0), Vec3(1, 2, 0.5)})[0].look_at, Vec3(0, 0, 0.25));
  EXPECT_EQ(placed_cameras(scene, Box{Vec3(-1, -2, 0), Vec3(1, 2, 0.5)})[1].look_at, Vec3(1, 2, 3));
  EXPECT_EQ(placed_cameras(scene, Box())[0].look_at, Vec3(0, 0, 0));  // nothing to see: any place will do
}

TEST(Camera, WithAPlaceAloneLooksAtTheMiddleOfWhatIsThere) {
  Scene scene;
  scene.camera.from = Vec3(0, -5, 2);
  const Box box{Vec3(-1, -2, 0), Vec3(1, 2, 0.5)};
  EXPECT_EQ(placed_cameras(scene, box)[0].from, Vec3(0, -5, 2));
  EXPECT_EQ(placed_cameras(scene, box)[0].look_at, Vec3(0, 0, 0.25));
  scene.camera.from = Vec3(0, 0, 0.25);
  EXPECT_NE(placed_cameras(scene, box)[0].look_at, scene.camera.from);
}

TEST(Camera, WithoutAPlaceSeesSurfacesObstaclesAndTheGroundBelow) {
  const auto placed = [](const std::string& rest) {
    Scene scene = parse_scene(R"(
schema: 1
duration: 0.1 s
objects:
  - name: ball
    particles: {arrange: single, at: [3, 2, 1], mass: 1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
)" + rest, "looks.yaml", ".");
    return *Simulation(std::move(scene)).model().cameras.at(0).look_at;
  };
  EXPECT_LT((placed("") - Vec3(3, 2, 1)).norm(), 1e-9);
  const Vec3 low = placed("ground: {height: -1}\n");
  EXPECT_LT((low.head<2>() - Vec3(3, 2, 0).head<2>()).norm(), 1e-9);
  EXPECT_NEAR(low.z(), 0.5 * (1.0 + 0.5 * std::sqrt(1.0 - std::cbrt(0.5)) - 1.0), 0.05);  // a bound of the ball's top
  EXPECT_EQ(placed("ground: {height: -1, visible: false}\n"), placed(""));
  const Vec3 beside = placed("obstacles: [{name: block, shape: box, at: [5, 2, 1], half_sizes: [0.5, 0.5, 0.5]}]\n");
  EXPECT_GT(beside.x(), 3.8);
  EXPECT_EQ(placed("obstacles: [{name: floor, shape: plane, at: [5, 2, -9]}]\n"), placed(""));
}

TEST(Camera, SeesBoxesAndTheirShadows) {
  const render::Camera camera{.from = Vec3(0, -5, 1), .look_at = Vec3(0, 0, 1), .up = Vec3::UnitZ(), .field_of_view = 0.6};
  const auto shows = [&](const Vec3& at, const Vec3& light) {
    return may_show(camera, 1.5, light, 0.03, Box{at, at}.inflated(0.3));
  };
  EXPECT_TRUE(shows(Vec3(0, 0, 1), Vec3(0, 0, -1)));
  EXPECT_FALSE(shows(Vec3(0, -9, 1), Vec3(0, -1, -1)));  // behind, shadow goes away
  EXPECT_TRUE(shows(Vec3(0, -9, 1), Vec3(0, 1, -0.2)));  // behind, shadow falls into the picture
  EXPECT_FALSE(shows(Vec3(9, 0, 1), Vec3(0.4, 0, -1)));  // beside
  EXPECT_TRUE(shows(Vec3(9, 0, 1), Vec3(-0.4, 0, -1)));
  EXPECT_TRUE(shows(Vec3(0, 0, 9), Vec3(0, 0, -1)));     // above, shadow below
  EXPECT_FALSE(shows(Vec3(0, 0, 9), Vec3(0, 0, 1)));
}

TEST(Camera, CellsKeepTheSagittaBelowTheError) {
  const double cell = cell_for(0.5, 0.001, 4.0, 0.3);
  EXPECT_NEAR(cell * cell / (8.0 * 0.3), 0.5 * 0.001 * 4.0, 1e-15);
}

TEST_F(Looks, WhatNoCameraSeesIsNotMeshed) {
  const std::string text = R"(
schema: 1
duration: 0.1 s
objects:
  - name: seen
    particles: {arrange: single, mass: 1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
  - name: unseen
    particles: {arrange: single, at: [0, -9, 0], mass: 1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
camera: {from: [0, -3, 1], look_at: [0, 0, 0]}
light: {direction: [0, -0.3, -1]}
)";
  const auto run = [&](const std::string& output, bool skip) {
    const Scene scene = parse_scene(text + output, "looks.yaml", ".");
    const RunResult done = run_scene(scene, {.folder = folder_, .frames = {1}, .threads = 1, .overwrite = true, .skip = skip});
    EXPECT_EQ(done.outcome, "done") << done.reason;
    return render::read_png(folder_ / "frames/looks.0001.png").pixels;
  };
  const auto visited = [&] {
    std::ifstream file(folder_ / "result.json");
    return nlohmann::json::parse(file).at("stages").at("polygonise").at("visited").get<std::uint64_t>();
  };
  const auto skipped = run("output: {images: {size: [160, 120]}}\n", true);
  const std::uint64_t few = visited();
  const auto whole = run("output: {images: {size: [160, 120]}}\n", false);
  EXPECT_LT(2 * few, visited() + 10);
  // The shadow map fits what is there, so shadows are sampled at other places: their edges differ, nothing else.
  ASSERT_EQ(skipped.size(), whole.size());
  double sum = 0.0;
  int edges = 0;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    sum += std::abs(skipped[i] - whole[i]);
    edges += std::abs(skipped[i] - whole[i]) > 24 ? 1 : 0;
  }
  EXPECT_LT(edges, static_cast<int>(whole.size() / 200));
  EXPECT_LT(sum / static_cast<double>(whole.size()), 0.5);
  run("output: {images: {size: [160, 120]}, mesh: ply}\n", true);  // files hold everything
  EXPECT_TRUE(fs::exists(folder_ / "meshes/looks.unseen.0001.ply"));
}

TEST_F(Looks, PixelErrorsChooseTheCells) {
  const auto visited = [&](const std::string& render) {
    const RunResult done = run_scene(scene_with("", render + kOneCamera), {.folder = folder_, .frames = {1}, .threads = 1, .overwrite = true});
    EXPECT_EQ(done.outcome, "done") << done.reason;
    std::ifstream file(folder_ / "result.json");
    return nlohmann::json::parse(file).at("stages").at("polygonise").at("visited").get<std::uint64_t>();
  };
  const std::uint64_t fine = visited("render: {pixel_error: 0.02}\n");
  EXPECT_GT(fine, visited("render: {pixel_error: 0.5}\n"));
}

TEST_F(Looks, ACameraInsideAnObjectIsAWarning) {
  const RunResult done = run_scene(scene_with("", "camera: {from: [0, 0.05, 0], look_at: [3, 0, 0]}\noutput: {images: {size: [32, 32]}}\n"),
                                   {.folder = folder_, .frames = {1}, .threads = 1});
  ASSERT_EQ(done.warnings.size(), 1u);
  EXPECT_NE(done.warnings[0].find("inside 'chain'"), std::string::npos) << done.warnings[0];
}

TEST_F(Looks, ChangeNoBitOfTheMotion) {
  const Scene plain = scene_with("", kOneCamera);
  const Scene coloured = scene_with("colour_by: stretch, range: [-0.1, 0.1], frames: 0.1", kOneCamera);
  EXPECT_EQ(plain.content_hash, coloured.content_hash);
  const RunResult a = run_scene(plain, {.folder = folder_ / "a", .threads = 1});
  const RunResult b = run_scene(coloured, {.folder = folder_ / "b", .threads = 1});
  EXPECT_EQ(a.state_hash, b.state_hash);
}

TEST_F(Looks, ShowWhatEachKeyAsksFor) {
  const render::Image plain = first_picture(scene_with("", kOneCamera));
  for (const char* look : {"metallic: 1", "opacity: 0.5", "texture: {pattern: checker, size: 0.07}", "texture: {pattern: stripes}",
                           "colour_by: pressure, range: [0, 100]", "colour_by: stretch, range: [-1, 1]",
                           "colour_by: speed, range: [0, 2]", "colour_by: normals", "wireframe: true", "surface: false",
                           "frames: 0.4", "surface: false, bonds: 0.02"}) {
    EXPECT_NE(first_picture(scene_with(look, kOneCamera)).pixels, plain.pixels) << look;
  }
  const auto with = [&](const std::string& more) { return first_picture(scene_with("", more + kOneCamera)); };
  EXPECT_NE(with("background: {top: [0, 0, 0]}\n").pixels, plain.pixels);
  EXPECT_NE(with("lights: [{at: [0, -1, 1], facing: [0, 1, -1]}]\n").pixels, plain.pixels);
  EXPECT_NE(with("light: {intensity: 1}\n").pixels, plain.pixels);
  EXPECT_NE(first_picture(scene_with("colour_by: speed, range: [0, 2], scale_bar: false", kOneCamera)).pixels,
            first_picture(scene_with("colour_by: speed, range: [0, 2]", kOneCamera)).pixels);
}

const std::vector<double>& column_of(const Mesh& mesh, const std::string& name) {
  return std::find_if(mesh.columns.begin(), mesh.columns.end(), [&](const auto& c) { return c.name == name; })->values;
}

TEST(Pressure, OfMeshesIsThatOfTheContactSurface) {
  // Unlike balls on each other and one on the ground.
  Simulation simulation(parse_scene(R"(
schema: 1
duration: 1 s
ground: {height: -0.3}
objects:
  - name: left
    particles: {arrange: single, at: [-0.25, 0, 0], mass: 0.5}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.8}}]
    contact: {modulus: 2e3}
    look: {colour_by: pressure, range: [0, 1000]}
  - name: right
    particles: {arrange: single, at: [0.25, 0.1, 0.3], mass: 0.5}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.8}}]
    contact: {modulus: 6e3}
    look: {colour_by: pressure, range: [0, 1000]}
)", "test.yaml", "."));
  ASSERT_EQ(simulation.contacts().summary.size(), 2u);
  const double largest = simulation.contacts().summary.front().largest_pressure;
  const std::array<double, 2> modulus = {2e3, 6e3};
  for (std::size_t i = 0; i < 2; ++i) {
    const Mesh& mesh = simulation.meshes()[i];
    std::vector<double> value(mesh.vertex_count());
    simulation.fields()[i].evaluate(mesh.position, value);
    double most = 0.0;
    for (std::size_t v = 0; v < value.size(); ++v) {
      const double pressure = column_of(mesh, "pressure")[v];
      if (mesh.position[v].z() < -0.3) continue;  // in the ground, which does not cut the surface
      most = std::max(most, pressure);
      // Vertices are roots to 1e-10 in units of F.
      const double expected = column_of(mesh, "contact")[v] > 0.0 ? std::max(0.0, modulus[i] * value[v]) : 0.0;
      EXPECT_NEAR(pressure, expected, 1e-9 * modulus[i]) << mesh.position[v].transpose();
    }
    // A vertex lies within a cell of the peak, about which the pressure falls by less than its second derivative over F, 6 / R^2, says.
    EXPECT_LE(most, largest * (1.0 + 1e-9));
    EXPECT_GE(most, largest - 6.0 / 0.64 * 2e3 * simulation.cell() * simulation.cell());
  }
}

TEST(Pressure, OnAFixedBodyIsThatOfTheContactSurfaceOverTheVertex) {
  // The surface is not cut there: of a ball in the ground and in a plane, a vertex shows the pressure where both are equal on the way out.
  constexpr double kBallModulus = 4e3, kGroundSlope = 2e4, kPlaneSlope = 5e4;  // [Pa], [Pa/m], [Pa/m]
  Simulation simulation(parse_scene(R"(
schema: 1
duration: 1 s
ground: {height: -0.3, modulus: 1e4, slope: 2}
obstacles:
  - {name: wall, shape: plane, at: [0.35, 0, 0], normal: [-1, 0, 0], modulus: 1e4, slope: 5}
objects:
  - name: ball
    particles: {arrange: single, at: [0, 0, 0], mass: 0.5}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.8}}]
    contact: {modulus: 4e3}
    look: {colour_by: pressure, range: [0, 1000]}
)", "test.yaml", "."));
  ASSERT_EQ(simulation.contacts().summary.size(), 2u);
  const Mesh& mesh = simulation.meshes()[0];
  const std::vector<double>& pressure = column_of(mesh, "pressure");
  double most = 0.0, largest = 0.0;
  for (const auto& s : simulation.contacts().summary) largest = std::max(largest, s.largest_pressure);
  for (std::size_t v = 0; v < pressure.size(); ++v) {
    const Vec3& x = mesh.position[v];
    const double below = -0.3 - x.z(), behind = x.x() - 0.35;
    most = std::max(most, pressure[v]);
    if (below <= 0.0 && behind <= 0.0) {
      EXPECT_EQ(pressure[v], 0.0) << x.transpose();
    } else {  // the ball's pressure at the place where the fixed body's is that of the vertex, if it is that body's
      const Vec3 over_ground = x + (below - pressure[v] / kGroundSlope) * Vec3::UnitZ();
      const Vec3 before_wall = x - (behind - pressure[v] / kPlaneSlope) * Vec3::UnitX();
      std::array<double, 2> value{};
      simulation.fields()[0].evaluate(std::array{over_ground, before_wall}, value);
      const double deepest = std::max(below * kGroundSlope, behind * kPlaneSlope);
      const double error = std::min(below > 0.0 ? std::abs(kBallModulus * value[0] - pressure[v]) : deepest, behind > 0.0 ? std::abs(kBallModulus * value[1] - pressure[v]) : deepest);
      EXPECT_LE(error, 1e-6 * deepest + 1e-9) << x.transpose() << ": " << pressure[v];
    }
  }
  // Within a cell of the peak the pressure falls by less than the ball's second derivative over F, 6 / R^2, says.
  EXPECT_LE(most, largest * (1.0 + 1e-6));
  EXPECT_GE(most, largest - 6.0 / 0.64 * kBallModulus * simulation.cell() * simulation.cell());
}

TEST_F(Looks, SpeedShowsTheColourOfItsValue) {
  // All move at 1 m/s, the middle of the map's range; the same scene in that colour looks the same.
  const std::string more = kOneCamera;
  const render::Image by_speed = first_picture(scene_with("colour_by: speed, map: grey, range: [0, 2], scale_bar: false", more));
  Scene same = scene_with("", more);
  same.objects[0].colour = Vec3::Constant(0.5);
  const render::Image plain = first_picture(same);
  ASSERT_EQ(plain.pixels.size(), by_speed.pixels.size());
  for (std::size_t i = 0; i < plain.pixels.size(); ++i) EXPECT_NEAR(plain.pixels[i], by_speed.pixels[i], 3);
}

TEST_F(Looks, SeveralCamerasLeaveImagesFilmsAndSheetsEach) {
  const Scene scene = scene_with("", R"(
cameras:
  - {name: front, from: [0, -3, 1], look_at: [0, 0, 0]}
  - {name: above, from: [0, -0.1, 4], look_at: [0, 0, 0], turntable_deg: 90}
output: {images: {size: [96, 64], samples: 1}, film: true}
)");
  ASSERT_EQ(run_scene(scene, {.folder = folder_, .threads = 1}).outcome, "done");
  for (const char* file : {"frames/looks.front.0001.png", "frames/looks.above.0003.png", "looks.front.mp4", "looks.above.mp4",
                           "looks.front_sheet.png", "looks.above_sheet.png"})
    EXPECT_TRUE(fs::exists(folder_ / file)) << file;
  const std::vector<fs::path> sheets = make_sheets(scene, folder_);
  EXPECT_EQ(sheets, (std::vector<fs::path>{folder_ / "looks.front_sheet.png", folder_ / "looks.above_sheet.png"}));
  EXPECT_FALSE(fs::exists(folder_ / "frames/looks.0001.png"));
  EXPECT_NE(render::read_png(folder_ / "frames/looks.front.0001.png").pixels,
            render::read_png(folder_ / "frames/looks.above.0001.png").pixels);
  ASSERT_EQ(run_scene(scene_with("", kOneCamera), {.folder = folder_, .threads = 1, .overwrite = true}).outcome, "done");
  EXPECT_FALSE(fs::exists(folder_ / "looks.front.mp4"));
}

TEST_F(Looks, PathTracerDrawsTheSameSceneOrIsNamedAsAbsent) {
  const std::string path = "render: {renderer: path, noise: 0, most_samples: 4}\n";
  const RunResult done = run_scene(scene_with("", path + kOneCamera), {.folder = folder_, .frames = {1}, .threads = 1});
  if (!render::has_path_tracer()) {
    EXPECT_NE(done.reason.find("Embree"), std::string::npos) << done.reason;
    return;
  }
  ASSERT_EQ(done.outcome, "done") << done.reason;
  const render::Image traced = render::read_png(folder_ / "frames/looks.0001.png");
  const render::Image drawn = first_picture(scene_with("", kOneCamera));
  double sum = 0.0;
  for (std::size_t i = 0; i < traced.pixels.size(); ++i) sum += std::abs(traced.pixels[i] - drawn.pixels[i]);
  EXPECT_LT(sum / static_cast<double>(traced.pixels.size()), 12.0);
  EXPECT_NE(traced.pixels, drawn.pixels);
  // Each key of `render` changes something; the threads do not.
  const auto with = [&](const std::string& keys, const std::string& camera = kOneCamera) {
    return first_picture(scene_with("", "render: {renderer: path, noise: 0, most_samples: 4" + keys + "}\n" + camera)).pixels;
  };
  EXPECT_EQ(with(""), traced.pixels);
  for (const char* keys : {", denoise: false", ", exact_surface: false", ", shutter: 1"}) EXPECT_NE(with(keys), traced.pixels) << keys;
  EXPECT_NE(with("", "camera: {from: [0, -3, 1], look_at: [0, 0, 0], aperture: 0.3, focus: 1}\noutput: {images: {size: [160, 120]}}\n"),
            traced.pixels);
}

TEST_F(Looks, PicturesAreTimedByTheirParts) {
  const RunResult done = run_scene(scene_with("", kOneCamera), {.folder = folder_, .frames = {1}, .threads = 1});
  EXPECT_EQ(done.pictures.images, 1);
  for (const double part : {done.pictures.render.context, done.pictures.render.shaders, done.pictures.render.upload,
                            done.pictures.render.draw, done.pictures.render.read_back, done.pictures.encode_s})
    EXPECT_GT(part, 0.0);
  std::ifstream file(folder_ / "result.json");
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  EXPECT_NE(text.find("\"read_back_cpu_s\""), std::string::npos);
}

TEST_F(Looks, AbsentTexturesAndFilmMakersAreNamedBeforeAnythingIsRemoved) {
  ASSERT_EQ(run_scene(scene_with("", kOneCamera), {.folder = folder_, .threads = 1}).outcome, "done");
  const RunOptions again{.folder = folder_, .threads = 1, .overwrite = true};
  const Scene absent = scene_with("texture: {pattern: picture, file: absent.png}", kOneCamera);
  RunResult result = run_scene(absent, again);
  EXPECT_EQ(result.outcome, "io");
  for (const char* part : {"absent.png", "objects.chain.look.texture.file"}) EXPECT_NE(result.reason.find(part), std::string::npos) << result.reason;
  EXPECT_THROW(check_pictures(absent), Error);
  EXPECT_NO_THROW(check_pictures(scene_with("", kOneCamera)));
  EXPECT_EQ(render_run(absent, again).outcome, "io");

  Scene film = scene_with("", kOneCamera);
  film.output.film.emplace();
  ::setenv("SUPPLE_FFMPEG", "/no/such/ffmpeg", 1);
  result = run_scene(film, again);
  ::unsetenv("SUPPLE_FFMPEG");
  EXPECT_EQ(result.outcome, "io");
  EXPECT_NE(result.reason.find("/no/such/ffmpeg"), std::string::npos) << result.reason;
  EXPECT_TRUE(fs::exists(folder_ / "frames/looks.0001.png"));
}

/// Two balls pressed together by a quarter of a radius; many samples and no filter, so that shapes alone differ.
Scene balls_that_touch(const std::string& look_of_b, const std::string& camera, const std::string& cell, bool exact) {
  return parse_scene(R"(
schema: 1
duration: 0.1 s
frame_rate: 10
gravity: [0, 0, 0]
objects:
  - {name: a, particles: {arrange: single, at: [-0.3, 0, 0]}, skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}], contact: {modulus: 1000}}
  - {name: b, particles: {arrange: single, at: [0.05, 0, 0.05]}, skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}], contact: {modulus: 2000}, look: {)" +
                         look_of_b + R"(}}
light: {direction: [-0.2, 1, -0.4], softness_deg: 0}
camera: )" + camera + R"(
render: {renderer: path, noise: 0, most_samples: 64, denoise: false, exact_surface: )" + (exact ? "true" : "false") +
                         "}\noutput: {images: {size: [96, 72]}, cell: " + cell + "}\n",
                     "looks.yaml", ".");
}

render::Image part_of(const render::Image& whole, int left, int top, int width, int height) {
  render::Image part{.width = width, .height = height, .pixels = {}};
  for (std::ptrdiff_t y = top; y < top + height; ++y) {
    const auto row = whole.pixels.begin() + 3 * (y * whole.width + left);
    part.pixels.insert(part.pixels.end(), row, row + 3 * std::ptrdiff_t{width});
  }
  return part;
}

TEST_F(Looks, CoarseMeshesOfBallsThatTouchLookLikeFineOnesWhenRaysMeetTheField) {
  const std::string camera = "{from: [0, -2, 0.4], look_at: [-0.1, 0, 0], field_of_view_deg: 30}";
  if (!render::has_path_tracer()) {
    EXPECT_NE(run_scene(balls_that_touch("", camera, "0.08", true), {.folder = folder_, .threads = 1}).reason.find("Embree"), std::string::npos);
    return;
  }
  // The middle, with the crease between the two: outlines stay those of the mesh.
  const auto middle = [&](const char* cell, bool exact) { return part_of(first_picture(balls_that_touch("", camera, cell, exact)), 30, 28, 34, 12); };
  const render::Image fine = middle("0.01", false);
  const double plain = render::compare(middle("0.08", false), fine, 1.0).psnr;
  const double met = render::compare(middle("0.08", true), fine, 1.0).psnr;
  EXPECT_GT(met, plain + 3.0);
}

TEST_F(Looks, DentsAreSeenThroughATransparentBodyThatMadeThem) {
  if (!render::has_path_tracer()) return;  // the test before this one says what is then refused
  const auto dent = [&](const char* cell, bool exact) {
    return part_of(first_picture(balls_that_touch("opacity: 0.05", "{from: [2, -0.3, 0.4], look_at: [-0.2, 0, 0], field_of_view_deg: 20}", cell, exact)), 36, 24, 24, 24);
  };
  const render::Image fine = dent("0.01", false);
  const double plain = render::compare(dent("0.08", false), fine, 1.0).psnr;
  EXPECT_GT(plain, 30.0);  // 21 where rays pass through the face that both have
  EXPECT_GT(render::compare(dent("0.08", true), fine, 1.0).psnr, plain + 3.0);
}

TEST_F(Looks, SeparateBodiesMeetRaysAsObjectsOfTheirOwnDo) {
  if (!render::has_path_tracer()) return;  // the test before this one says what is then refused
  const std::string keys = ", skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}], contact: {modulus: 1000}, colour: [0.8, 0.4, 0.2]";
  const auto picture = [&](const std::string& objects) {
    return first_picture(parse_scene("schema: 1\nduration: 0.1 s\nframe_rate: 10\ngravity: [0, 0, 0]\nobjects:\n" + objects + R"(
light: {direction: [-0.2, 1, -0.4]}
camera: {from: [0, -3, 0.4], look_at: [0, 0, 0], field_of_view_deg: 40}
render: {renderer: path, noise: 0, most_samples: 16, denoise: false}
output: {images: {size: [96, 72]}, cell: 0.08}
)", "looks.yaml", "."));
  };
  std::string apart;
  int number = 0;
  for (const char* at : {"[-0.5, 0, 0]", "[-0.125, 0, 0]", "[0.25, 0, 0]"}) {
    apart += "  - {name: body_" + std::to_string(number++) + ", particles: {arrange: single, at: " + at + "}" + keys + "}\n";
  }
  const render::Image one_object = picture("  - {name: bodies, separate: true, particles: {arrange: line, count: 3, spacing: 0.375, at: [-0.125, 0, 0]}" + keys + "}\n");
  EXPECT_EQ(one_object.pixels, picture(apart).pixels);
}

}  // namespace
}  // namespace supple::scenes
