#include "output_files.h"

#include <time.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "supple/core/io/mesh_files.h"
#include "supple/core/parts.h"
#include "supple/implicit/surface_grid.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

constexpr int kSheetColumns = 4;
constexpr int kSheetRows = 3;
constexpr int kSheetImageWidth = 320;
constexpr int kSheetGap = 4;

std::string numbered(const std::string& name, int frame, const std::string& extension) {
  std::array<char, 16> digits{};
  std::snprintf(digits.data(), digits.size(), ".%04d", frame);
  return name + digits.data() + extension;
}

double process_cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace

StageClock::StageClock(StageProfile& profile) : profile_(profile), begin_(process_cpu_seconds()) { ++profile.calls; }
StageClock::~StageClock() { profile_.cpu_s += process_cpu_seconds() - begin_; }

fs::path state_path(const fs::path& folder, const std::string& name, int frame) {
  return folder / "states" / numbered(name, frame, ".state");
}

fs::path frame_path(const fs::path& folder, const std::string& name, int frame) {
  return folder / "frames" / numbered(name, frame, ".png");
}

void remove_outputs(const fs::path& folder, const std::string& name) {
  std::error_code ignored;
  for (const char* part : {"states", "frames", "meshes", "grids", "contacts", "particles"}) {
    if (!fs::is_directory(folder / part)) continue;
    for (const auto& entry : fs::directory_iterator(folder / part)) {
      if (entry.path().filename().string().starts_with(name + ".")) fs::remove(entry.path(), ignored);
    }
  }
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string file = entry.path().filename().string();
    const bool ours = file.starts_with(name + '.') || file == name + "_sheet.png";
    if (ours && (file.ends_with(".mp4") || file.ends_with("_sheet.png"))) fs::remove(entry.path(), ignored);
  }
  fs::remove(folder / "result.json", ignored);
}

void write_mesh_files(const fs::path& folder, const std::string& name, int frame, const Simulation& simulation,
                      const std::vector<Mesh>& meshes) {
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (meshes[i].position.empty()) continue;
    io::write_ply(folder / "meshes" / numbered(name + "." + simulation.model().objects[i].name, frame, ".ply"),
                  meshes[i]);
  }
}

void write_grid_file(const fs::path& folder, const std::string& name, int frame, Simulation& simulation) {
  const std::vector<Body>& bodies = simulation.bodies();
  const Executor executor(1);
  std::vector<implicit::SurfaceGrid> grids;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (bodies[i].skeleton.primitive.empty()) continue;
    implicit::GridOptions options;
    options.lattice.cell = simulation.cell();
    options.name = bodies[i].name;
    grids.push_back(implicit::make_surface_grid(simulation.fields()[i], options, executor));
  }
  implicit::write_grids(folder / "grids" / numbered(name, frame, ".vdb"), grids);
}

void write_contact_table(const fs::path& folder, const std::string& name, int frame, Simulation& simulation) {
  const collision::ContactSurface& surface = simulation.contacts();
  const std::size_t n = surface.point.size();
  std::array<std::vector<double>, 10> columns;
  for (auto& column : columns) column.resize(n);
  for (std::size_t s = 0; s < n; ++s) {
    const collision::BodyPair& bodies = surface.summary[surface.pair[s]].bodies;
    columns[0][s] = bodies.a;
    columns[1][s] = bodies.b;
    for (std::size_t k = 0; k < 3; ++k) {
      columns[2 + k][s] = surface.point[s][static_cast<Eigen::Index>(k)];
      columns[5 + k][s] = surface.normal[s][static_cast<Eigen::Index>(k)];
    }
    columns[8][s] = surface.area[s];
    columns[9][s] = surface.pressure[s];
  }
  constexpr std::array<const char*, 10> kNames = {"body_a",   "body_b",   "x_m",      "y_m",     "z_m",
                                                  "normal_x", "normal_y", "normal_z", "area_m2", "pressure_pa"};
  std::vector<io::TableColumn> table;
  for (std::size_t c = 0; c < columns.size(); ++c) table.push_back({kNames[c], columns[c]});
  io::write_csv(folder / "contacts" / numbered(name, frame, ".csv"), table);
}

void write_particle_table(const fs::path& folder, const std::string& name, int frame, const Simulation& simulation) {
  const core::ParticleState& state = simulation.state().particles;
  const std::size_t n = state.size();
  std::array<std::vector<double>, 14> columns;
  for (auto& column : columns) column.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    columns[0][i] = simulation.model().particles.object[i];
    for (std::size_t k = 0; k < 3; ++k) {
      const auto axis = static_cast<Eigen::Index>(k);
      columns[1 + k][i] = state.position[i][axis];
      columns[8 + k][i] = state.velocity[i][axis];
      columns[11 + k][i] = state.angular_momentum[i][axis];
    }
    for (std::size_t k = 0; k < 4; ++k) columns[4 + k][i] = state.orientation[i].coeffs()[static_cast<Eigen::Index>(k)];
  }
  constexpr std::array<const char*, 14> kNames = {"object", "x_m",    "y_m",    "z_m",    "qx",    "qy",    "qz",
                                                  "qw",     "vx_m_s", "vy_m_s", "vz_m_s", "lx_si", "ly_si", "lz_si"};
  std::vector<io::TableColumn> table;
  for (std::size_t c = 0; c < columns.size(); ++c) table.push_back({kNames[c], columns[c]});
  io::write_csv(folder / "particles" / numbered(name, frame, ".csv"), table);
}

void write_contact_sheet(const fs::path& folder, const std::string& name, int last) {
  std::vector<int> present;
  for (int frame = 1; frame <= last; ++frame) {
    if (fs::exists(frame_path(folder, name, frame))) present.push_back(frame);
  }
  const int wanted = std::min<int>(kSheetColumns * kSheetRows, static_cast<int>(present.size()));
  std::vector<render::Image> images;
  for (int k = 0; k < wanted; ++k) {
    const std::size_t index =
        wanted == 1 ? 0 : static_cast<std::size_t>(std::lround(k * (static_cast<double>(present.size()) - 1) / (wanted - 1)));
    const render::Image frame = render::read_png(frame_path(folder, name, present[index]));
    images.push_back(render::downscale(frame, std::min(kSheetImageWidth, frame.width)));
  }
  if (images.empty()) return;
  render::write_png(folder / (name + "_sheet.png"), render::contact_sheet(images, kSheetColumns, kSheetGap));
}

}  // namespace supple::scenes
