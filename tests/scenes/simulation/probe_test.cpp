#include "supple/scenes/probe.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>

#include "supple/core/error.h"
#include "supple/render/image.h"
#include "supple/scenes/contact_report.h"
#include "supple/scenes/pictures.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

std::string ball(const std::string& name, const std::string& at, const std::string& rest = "") {
  return "  - name: " + name + "\n    particles: {arrange: single, at: " + at + ", mass: 0.5}\n" +
         "    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.8}}]\n    contact: {modulus: 2e3" + rest + "}\n";
}

constexpr const char* kHead = "schema: 1\nduration: 1 s\nframe_rate: 8\nground: {height: -0.5}\nobjects:\n";

/// Two balls that press on each other, and more.
Simulation make(const std::string& more = "", const std::vector<std::string>& overrides = {}) {
  return Simulation(parse_scene(kHead + ball("left", "[-0.25, 0, 0]") + ball("right", "[0.25, 0.1, 0]") + more, "test.yaml", ".", overrides));
}

std::string message(const auto& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Usage);
    return error.what();
  }
  return "nothing";
}

TEST(FindBody, KnowsObjectsAndFixedBodies) {
  const Simulation simulation = make();
  EXPECT_EQ(find_body(simulation, "left"), 0u);
  EXPECT_EQ(find_body(simulation, "right"), 1u);
  EXPECT_EQ(find_body(simulation, "ground"), 2u);
  EXPECT_EQ(message([&] { static_cast<void>(find_body(simulation, "rigth")); }),
            "body: expected the name of a body, found 'rigth'; did you mean 'right'? (known: left, right, ground)");
}

TEST(EvaluateField, IsThatOfTheKernelAndOfThePlane) {
  Simulation simulation = make();
  const Vec3 centre(-0.25, 0, 0);
  const std::array points = {centre, Vec3(centre + Vec3(0.2, 0, 0)), Vec3(0, 5, 0), Vec3(1, 2, -0.5), Vec3(0, 0, -0.75)};
  std::array<double, 5> value{};
  std::array<Vec3, 5> gradient{};
  evaluate_field(simulation, 0, points, value, gradient);
  // (1 - rho^2)^3 - 1/2, rho = r / 0.8, and its derivative.
  EXPECT_DOUBLE_EQ(value[0], 0.5);
  const double inner = 1.0 - 0.0625;
  EXPECT_NEAR(value[1], inner * inner * inner - 0.5, 1e-15);
  EXPECT_NEAR(gradient[1].x(), -6.0 * inner * inner * 0.2 / 0.64, 1e-14);
  EXPECT_EQ(value[2], -0.5);
  evaluate_field(simulation, find_body(simulation, "ground"), points, value, gradient);
  EXPECT_NEAR(value[3], 0.0, 1e-15);
  EXPECT_GT(value[4], 0.0);
  EXPECT_NEAR(value[4], -0.25 * gradient[4].z(), 1e-15);
  EXPECT_EQ(gradient[4].head<2>(), Eigen::Vector2d::Zero());
}

TEST(EvaluateField, NeedsASurface) {
  Simulation simulation = make("  - name: bare\n    particles: {arrange: single, at: [3, 0, 0], mass: 1, inertia_radius: 0.1}\n");
  const Vec3 point = Vec3::Zero();
  double value = 0.0;
  Vec3 gradient;
  EXPECT_EQ(message([&] { evaluate_field(simulation, find_body(simulation, "bare"), {&point, 1}, {&value, 1}, {&gradient, 1}); }),
            "body: expected a body with a surface, found 'bare' without a skeleton");
}

TEST(ReportForces, EndsWithContactAndAddsUpToTheEnergies) {
  Simulation simulation = make(ball("chain", "[0, 0, 3]") + "gravity: [0, 0, -10]\n");
  const std::vector<core::LawReport> laws = report_forces(simulation);
  ASSERT_GE(laws.size(), 2u);
  EXPECT_EQ(laws.back().name, "contact");
  EXPECT_GT(laws.back().energy, 0.0);
  EXPECT_DOUBLE_EQ(laws.back().energy, simulation.energies().contact);
  const ContactReport contacts = report_contacts(simulation);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(laws.back().loads.force[i], contacts.loads.force[i]);
  double weight = 0.0;
  for (const core::LawReport& law : laws) {
    if (law.name == "gravity") weight += law.loads.force[2].z();
  }
  EXPECT_DOUBLE_EQ(weight, -5.0);
}

TEST(SolveContact, KeepsItsBoundAtEveryError) {
  // Against the same at 1e-10.
  Simulation simulation = make();
  const auto exact = solve_contact(simulation, 0, 1, 1e-10).summary;
  ASSERT_EQ(exact.size(), 1u);
  for (const double error : {1e-2, 1e-4, 1e-7}) {
    const auto found = solve_contact(simulation, 1, 0, error).summary;
    ASSERT_EQ(found.size(), 1u);
    EXPECT_LE(found[0].error_estimate, error);
    EXPECT_LE((found[0].force - exact[0].force).norm(), (found[0].error_estimate + 1e-10) * exact[0].force.norm());
    EXPECT_LE(std::abs(found[0].area - exact[0].area), (found[0].error_estimate + 1e-10) * exact[0].area);
    EXPECT_LT(found[0].evaluations, exact[0].evaluations);
    EXPECT_EQ(found[0].bodies, (collision::BodyPair{0, 1}));
  }
}

TEST(SolveContact, KnowsTheTwoBodiesOnly) {
  // A third ball takes some of the patch of the two.
  Simulation three = make(ball("third", "[0, 0, 0.35]")), two = make();
  const auto& shared = three.contacts().summary.front();
  const auto alone = solve_contact(three, 0, 1, 1e-8).summary.at(0), expected = solve_contact(two, 0, 1, 1e-8).summary.at(0);
  EXPECT_LT(shared.area, 0.99 * alone.area);
  EXPECT_LE(std::abs(alone.area - expected.area), 2e-8 * expected.area);
  EXPECT_LE((alone.force - expected.force).norm(), 2e-8 * expected.force.norm());
}

TEST(SolveContact, OfBodiesApartIsEmptyAndChangesNothing) {
  Simulation simulation = make(), untouched = make();
  EXPECT_TRUE(solve_contact(simulation, 0, find_body(simulation, "ground"), 1e-4).summary.empty());
  static_cast<void>(solve_contact(simulation, 0, 1, 1e-6));
  simulation.step_frame();
  untouched.step_frame();
  EXPECT_EQ(simulation.state_hash(), untouched.state_hash());
  EXPECT_EQ(message([&] { static_cast<void>(solve_contact(simulation, 1, 1, 1e-4)); }), "b: expected two bodies, found 'right' twice");
  EXPECT_EQ(message([&] { static_cast<void>(solve_contact(simulation, 0, 1, 0.5)); }),
            "error: expected a relative error from 1e-10 to 0.1, found 0.5");
}

TEST(ContactCapacity, HoldsTwiceTheEnergyOfTwiceTheModulus) {
  // Pressures, and so energies, are proportional to the moduli. The sum over cells is the same up to round-off.
  Simulation soft = make(), stiff = make("", {"objects.left.contact.modulus=4e3", "objects.right.contact.modulus=4e3"});
  const double capacity = contact_capacity(soft, 0, 1);
  EXPECT_GT(capacity, soft.contacts().summary.front().energy);
  EXPECT_NEAR(contact_capacity(stiff, 1, 0) / capacity, 2.0, 1e-9);
  EXPECT_EQ(message([&] { static_cast<void>(contact_capacity(soft, 0, 2)); }), "b: expected a body that touches 'left', found 'ground'");
}

TEST(DrawPicture, IsTheFrameOfARun) {
  // What lies far below is in no picture, nor is its shadow.
  const std::string text = "schema: 1\nduration: 1 s\nframe_rate: 8\nobjects:\n" + ball("left", "[-0.25, 0, 0]") +
                           ball("right", "[0.25, 0.1, 0]") + ball("under", "[0, 0, -90]") +
                           "cameras:\n  - {name: front, from: [0, -4, 1], look_at: [0, 0, 0]}\n  - {name: side, from: [4, 0, 1], look_at: [0, 0, 0]}\n" +
                           "render: {pixel_error: 0.5}\noutput: {images: {size: [64, 48]}}\n";
  const Scene scene = parse_scene(text, "test.yaml", ".");
  const fs::path folder = temp_folder() / "draw_picture";
  fs::remove_all(folder);
  ASSERT_EQ(run_scene(scene, {.folder = folder, .frames = {2}, .threads = 1}).outcome, "done");
  Simulation simulation(scene), plain(scene);
  simulation.step_frame();
  plain.step_frame();
  for (const char* camera : {"front", "side"}) {
    const render::Image picture = draw_picture(simulation, {.camera = camera});
    const render::Image frame = render::read_png(folder / "frames" / ("test." + std::string(camera) + ".0002.png"));
    EXPECT_EQ(picture.width, 64);
    EXPECT_EQ(picture.pixels, frame.pixels) << camera;
  }
  const render::Image small = draw_picture(simulation, {.width = 40, .height = 30});
  EXPECT_EQ(small.pixels.size(), 3u * 40 * 30);
  // Meshes, of the body out of sight too, and states are as without pictures.
  EXPECT_EQ(simulation.cell(), plain.cell());
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(simulation.meshes()[i].position, plain.meshes()[i].position);
  EXPECT_GT(simulation.meshes()[0].vertex_count(), 0u);
  EXPECT_EQ(simulation.state_hash(), plain.state_hash());
  EXPECT_EQ(message([&] { static_cast<void>(draw_picture(simulation, {.camera = "font"})); }),
            "camera: expected the name of a camera, found 'font'; did you mean 'front'? (known: front, side)");
}

}  // namespace
}  // namespace supple::scenes
