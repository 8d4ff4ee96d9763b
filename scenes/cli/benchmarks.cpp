#include "benchmarks.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>
#include <vector>

#include "installed_program.h"
#include "supple/core/error.h"

namespace supple::tool {
namespace {

namespace fs = std::filesystem;

struct Group {
  std::string_view name;
  std::string_view program;
  std::string_view measures;
  bool names = false;  ///< the program takes the rest of a name that begins with the group
};

constexpr std::array<Group, 19> kGroups{{
    {"core", "core_bench", "particle loops, lists and whole steps (melt, surface, lists, spiral, threads)", true},
    {"core/integrators", "integrator_bench", "time against error of every integrator; with a file name: plot (SVG)"},
    {"core/stability", "core_stress", "largest stable steps; with a file name: map (SVG)"},
    {"implicit", "field_bench", "fields (few, fit, w1, w2, w3, w4)", true},
    {"implicit/mesh", "mesh_bench", "surface meshes and their errors (w1/64 to w4/512)", true},
    {"collision", "contact_bench", "one contact query: time, points and error; with a file name: also the plot of collision/rules"},
    {"collision/poses", "contact_poses", "contact queries in random poses: worst time and error; arguments: number of poses, case"},
    {"collision/calibration", "contact_calibration", "share of random poses whose true error exceeds the estimate; arguments: number of poses, case, seed"},
    {"collision/invariance", "contact_invariance", "differences between swapped, rotated and scaled queries; arguments: number of poses, case"},
    {"collision/bodies", "contact_bodies", "contact queries of bodies of many primitives; arguments: number of poses, case"},
    {"collision/several", "contact_several", "three and four bodies in one place against sums over volumes; arguments: number of groups, seed"},
    {"collision/thin", "contact_thin", "contact queries of bodies that barely overlap; arguments: number of poses, seed"},
    {"collision/rules", "contact_rules", "time against error of the rules of the contact surface; with a file name: plot (SVG)"},
    {"collision/stability", "contact_stress", "stability of contact in extreme scenes; arguments: --seed N, file name of a map (SVG)"},
    {"collision/pile", "contact_pile", "steps of settled balls, up to 100,000; arguments: numbers of balls"},
    {"collision/conservation", "contact_conservation", "momenta and energy of free balls; arguments: number of steps"},
    {"scenes", "scene_bench", "whole scenes at an accuracy: CPU time, errors against a reference (jelly, pile_rests, slide ...); arguments: --accuracy A", true},
    {"fit", "fit_bench", "fits of data: error by number of primitives and time, beside spheres and equal blobs; arguments: file of data, errors"},
    {"render", "render_bench", "pictures: gl (1280 x 720, 200,000 triangles), path (640 x 360, to a given noise)", true},
}};

/// The program of all benchmarks. Empty: none.
fs::path benchmark_program() { return installed_program("supple_bench"); }

}  // namespace

std::string list_benchmarks() {
  const bool built = !benchmark_program().empty();
  std::string text;
  for (const Group& group : kGroups) {
    std::string line(group.name);
    line.resize(26, ' ');
    line += built ? "built      " : "not built  ";
    text += line.append(group.measures) + '\n';
  }
  return text;
}

void run_benchmark(const std::string& group, std::span<const std::string> arguments) {
  // The longest group that begins the name: "core/stability" before "core", whose program takes the rest of the name.
  const Group* found = nullptr;
  for (const Group& known : kGroups) {
    const bool leads = group == known.name || group.starts_with(std::string(known.name) + '/');
    if (leads && (known.names || group == known.name) && (found == nullptr || known.name.size() > found->name.size())) found = &known;
  }
  if (found == nullptr) {
    std::string known;
    for (const Group& one : kGroups) known.append(known.empty() ? "" : ", ").append(one.name);
    throw Error(ErrorKind::Usage, Fault{.place = "bench",
                                        .key = {},
                                        .expected = "expected a group of benchmarks",
                                        .found = "'" + group + "'",
                                        .hint = "known: " + known + "; supple bench --list says what they measure"});
  }
  const fs::path program = benchmark_program();
  if (program.empty()) {
    throw Error(ErrorKind::Io, Fault{.place = "supple_bench",
                                     .key = {},
                                     .expected = "expected the program of the benchmarks beside the tool or in libexec/supple",
                                     .found = "none",
                                     .hint = "in a source tree: cmake --build build/release --target benchmarks"});
  }
  std::vector<std::string> words{std::string(found->program)};
  if (group.size() > found->name.size()) words.push_back(group.substr(found->name.size() + 1));
  words.insert(words.end(), arguments.begin(), arguments.end());
  become_program(program, std::move(words));
}

}  // namespace supple::tool
