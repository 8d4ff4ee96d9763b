#include "fit/cloud.h"

#define CGAL_EIGEN3_ENABLED
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/IO/read_ply_points.h>
#include <CGAL/Poisson_reconstruction_function.h>
#include <CGAL/Random.h>
#include <CGAL/compute_average_spacing.h>
#include <CGAL/grid_simplify_point_set.h>
#include <CGAL/jet_estimate_normals.h>
#include <CGAL/mst_orient_normals.h>
#include <CGAL/property_map.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "fit/data.h"
#include "fit/grid_field.h"
#include "fit/surface.h"
#include "supple/core/interrupt.h"
#include "supple/core/io/number_range.h"

namespace supple::fit {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Vector = Kernel::Vector_3;
using Oriented = std::pair<Point, Vector>;
using PointMap = CGAL::First_of_pair_property_map<Oriented>;
using NormalMap = CGAL::Second_of_pair_property_map<Oriented>;
using PoissonFunction = CGAL::Poisson_reconstruction_function<Kernel>;  // less than 0 inside

constexpr unsigned kNeighbours = 18;
constexpr std::size_t kFewest = 50, kMost = 50'000'000, kEnough = 20'000;

const auto kMaps = CGAL::parameters::point_map(PointMap()).normal_map(NormalMap());

/// Rows of three or six numbers; empty ones and those that begin with # are left out.
std::vector<Oriented> read_xyz(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::vector<Oriented> out;
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    std::replace(line.begin(), line.end(), ',', ' ');
    if (line.find_first_not_of(" \t\r") == std::string::npos || line[line.find_first_not_of(" \t")] == '#') continue;
    std::istringstream words(line);
    std::vector<double> row;
    for (double value = 0.0; words >> value;) row.push_back(value);
    if (!words.eof() || (row.size() != 3 && row.size() != 6)) {
      refuse(file.string() + ':' + std::to_string(number), "expected three coordinates, or these and a normal", line.size() > 60 ? line.substr(0, 60) + "..." : line, "remove lines that are no points");
    }
    out.emplace_back(Point(row[0], row[1], row[2]), row.size() == 6 ? Vector(row[3], row[4], row[5]) : Vector(0.0, 0.0, 0.0));
    if (out.size() > kMost) refuse(file, "expected at most " + std::to_string(kMost) + " points", "more", "thin them out", ErrorKind::Limit);
  }
  return out;
}

std::vector<Oriented> read_points(const std::filesystem::path& file) {
  if (extension_of(file) == ".xyz") return read_xyz(file);
  std::ifstream in(file, std::ios::binary);
  std::vector<Oriented> out;
  if (!CGAL::IO::read_PLY_with_properties(in, std::back_inserter(out), CGAL::make_ply_point_reader(PointMap()), CGAL::make_ply_normal_reader(NormalMap()))) {
    refuse(file, "expected points", "text or bytes that are none, or that end early", "the extension says how a file is read");
  }
  return out;
}

/// @pre at least one point
double diagonal_of(const std::vector<Oriented>& points) {
  CGAL::Bbox_3 box;
  for (const Oriented& p : points) box += p.first.bbox();
  return std::sqrt(CGAL::square(box.x_span()) + CGAL::square(box.y_span()) + CGAL::square(box.z_span()));
}

/// Finite, one of equal ones, and not many more than the error needs.
void thin_out(const std::filesystem::path& file, double error, std::vector<Oriented>& points) {
  for (const Oriented& p : points) {
    for (int k = 0; k < 3; ++k) {
      if (!(std::abs(p.first[k]) <= io::kLargestNumber && std::abs(p.second[k]) <= io::kLargestNumber)) refuse(file, "expected finite coordinates", short_number(p.first[k]), "remove points without a place");
    }
  }
  const auto before = [](const Oriented& a, const Oriented& b) { return a.first < b.first; };
  const auto equal = [](const Oriented& a, const Oriented& b) { return a.first == b.first; };
  std::stable_sort(points.begin(), points.end(), before);
  points.erase(std::unique(points.begin(), points.end(), equal), points.end());
  if (points.size() < kFewest) refuse(file, "expected at least " + std::to_string(kFewest) + " different points", std::to_string(points.size()), "sample the surface more densely");
  if (points.size() <= kEnough) return;
  points.erase(CGAL::grid_simplify_point_set(points, 0.25 * error * diagonal_of(points), CGAL::parameters::point_map(PointMap())), points.end());
}

/// Turns normals alike along a minimum spanning tree of neighbours. Where these do not connect all points, more of them count; parts that stay apart are turned
/// each by itself, the normal of its highest point upwards. Points with too few others around are left out.
void turn_alike(std::vector<Oriented>& points) {
  constexpr unsigned kMostNeighbours = 8 * kNeighbours;
  std::vector<Oriented> out;
  unsigned neighbours = kNeighbours;
  while (points.size() > kNeighbours) {
    const auto rest = CGAL::mst_orient_normals(points, neighbours, kMaps);
    if (rest != points.end() && neighbours < kMostNeighbours) {
      neighbours *= 2;
      continue;
    }
    out.insert(out.end(), points.begin(), rest);
    points.erase(points.begin(), rest);
    neighbours = kNeighbours;
  }
  points = std::move(out);
}

/// @return whether the file had them
bool complete_normals(const std::filesystem::path& file, std::vector<Oriented>& points) {
  const auto none = [](const Oriented& p) { return !(p.second.squared_length() > 0.0); };
  if (std::none_of(points.begin(), points.end(), none)) return true;
  CGAL::jet_estimate_normals<CGAL::Sequential_tag>(points, kNeighbours, kMaps);
  turn_alike(points);
  if (points.size() < kFewest) refuse(file, "expected points that lie on a surface", "hardly any with a normal", "give normals in the file");
  return false;
}

/// Poisson's function on a lattice, more than 0 inside.
struct Sampled {
  GridField field;
  Vec3 first;         ///< place of the first node
  double step = 0.0;  ///< from one to the next
};

Vec3 vec3(const Point& p) { return {p.x(), p.y(), p.z()}; }

/// Boxes of the tetrahedra through which the surface goes. The function is linear in each. @param largest  receives the largest size of a value at a corner
std::vector<Box> boxes_of_surface(const PoissonFunction& function, double& largest) {
  std::vector<Box> out;
  const auto& mesh = function.tr();
  for (auto cell = mesh.finite_cells_begin(); cell != mesh.finite_cells_end(); ++cell) {
    Box box;
    int inside = 0;
    for (int k = 0; k < 4; ++k) {
      const auto corner = cell->vertex(k);
      box.include(vec3(corner->point()));
      largest = std::max(largest, std::abs(corner->f()));
      inside += corner->f() < 0.0 ? 1 : 0;
    }
    if (inside != 0 && inside != 4) out.push_back(box);
  }
  return out;
}

/// Values at nodes near the surface are means of eight around, which removes dents and bubbles as large as the differences between single points. Where no
/// surface is near, all nodes of a row in one stretch have the value of the first. Points are asked for one after another in one order, as places on faces
/// between tetrahedra have a value by each.
/// @param spacing  of the points
Sampled sample_function(const PoissonFunction& function, double spacing) {
  constexpr double kStep = 0.75, kMostNodes = 3e7, kReach = 1.5, kBorder = 2.5;  // a step over the spacing; what a box reaches beyond, and the lattice, in steps
  double largest = 0.0;
  const std::vector<Box> boxes = boxes_of_surface(function, largest);
  Sampled out;
  if (boxes.empty()) return out;
  Box all;
  for (const Box& box : boxes) {
    all.include(box.lower);
    all.include(box.upper);
  }
  out.step = std::max(kStep * spacing, std::cbrt(all.extent().prod() / kMostNodes));
  out.first = all.lower - Vec3::Constant(kBorder * out.step);
  GridField& field = out.field;
  const auto node_below = [&out](const Vec3& p, int axis) { return static_cast<std::size_t>(std::max(0.0, std::floor((p[axis] - out.first[axis]) / out.step))); };
  for (int k = 0; k < 3; ++k) field.count[static_cast<std::size_t>(k)] = node_below(all.upper + Vec3::Constant(kBorder * out.step), k) + 2;
  field.value.assign(field.count[0] * field.count[1] * field.count[2], -static_cast<float>(largest));
  std::vector<char> near(field.value.size(), 0);
  for (const Box& box : boxes) {
    const Box reached = box.inflated(kReach * out.step);
    for (std::size_t k = node_below(reached.lower, 2); k <= node_below(reached.upper, 2); ++k) {
      for (std::size_t j = node_below(reached.lower, 1); j <= node_below(reached.upper, 1); ++j) {
        std::fill(near.begin() + static_cast<std::ptrdiff_t>(field.at(node_below(reached.lower, 0), j, k)), near.begin() + static_cast<std::ptrdiff_t>(field.at(node_below(reached.upper, 0), j, k) + 1), char{1});
      }
    }
  }
  const auto value_at = [&](const Vec3& p) { return std::max(-function(Point(p.x(), p.y(), p.z())), -largest); };
  const auto mean_about = [&](const Vec3& p) {
    double sum = 0.0;
    for (const double z : {-0.25, 0.25}) {
      for (const double y : {-0.25, 0.25}) {
        for (const double x : {-0.25, 0.25}) sum += value_at(p + out.step * Vec3(x, y, z));
      }
    }
    return 0.125 * sum;
  };
  for (std::size_t k = 1; k + 1 < field.count[2]; ++k) {
    heed_scope();
    for (std::size_t j = 1; j + 1 < field.count[1]; ++j) {
      for (std::size_t i = 1; i + 1 < field.count[0]; ++i) {
        const std::size_t node = field.at(i, j, k);
        const Vec3 place = out.first + out.step * Vec3(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k));
        const bool stretch = near[node] == 0 && near[node - 1] == 0 && i > 1;
        field.value[node] = near[node] != 0 ? static_cast<float>(mean_about(place)) : stretch ? field.value[node - 1] : static_cast<float>(value_at(place));
      }
    }
  }
  return out;
}

/// Parts of the inside at which as good as no point lies are none of the data. @return whether any is left
bool drop_empty_parts(const std::vector<Oriented>& points, Sampled& sampled) {
  GridField& field = sampled.field;
  std::vector<std::uint32_t> part;
  std::vector<std::size_t> found(parts_of(field, true, part).size(), 0);
  for (const Oriented& p : points) {
    const Vec3 index = (vec3(p.first) - sampled.first) / sampled.step;
    std::array<std::uint32_t, 8> seen{};
    seen.fill(kNoPart);
    for (std::size_t corner = 0; corner < seen.size(); ++corner) {
      const std::array<std::size_t, 3> up{corner & 1, corner >> 1 & 1, corner >> 2};
      std::array<std::size_t, 3> node{};
      bool within = true;
      for (std::size_t k = 0; k < 3; ++k) {
        const double along = std::floor(index[static_cast<int>(k)]) + static_cast<double>(up[k]);
        within = within && along >= 0.0 && along < static_cast<double>(field.count[k]);
        if (within) node[k] = static_cast<std::size_t>(along);
      }
      if (!within) continue;
      const std::uint32_t here = part[field.at(node[0], node[1], node[2])];
      if (here == kNoPart || std::find(seen.begin(), seen.end(), here) != seen.end()) continue;
      seen[corner] = here;
      ++found[here];
    }
  }
  for (std::size_t n = 0; n < part.size(); ++n) {
    if (part[n] != kNoPart && found[part[n]] < kNeighbours) field.value[n] = -field.value[n];
  }
  return std::any_of(found.begin(), found.end(), [](std::size_t count) { return count >= kNeighbours; });
}

/// RMS distance of points to a mesh.
double rms_distance(const std::vector<Oriented>& points, const Mesh& mesh) {
  const SurfaceTree tree(mesh);
  double sum = 0.0;
  for (const Oriented& p : points) {
    const double distance = tree.distance(vec3(p.first));
    sum += distance * distance;
  }
  return std::sqrt(sum / static_cast<double>(points.size()));
}

}  // namespace

Mesh surface_through_points(const std::filesystem::path& file, double error, Repair& repair, const Executor& executor) {
  std::vector<Oriented> points = read_points(file);
  repair.points = points.size();
  thin_out(file, error, points);
  heed_scope();
  repair.normals_given = complete_normals(file, points);
  heed_scope();
  const double spacing = CGAL::compute_average_spacing<CGAL::Sequential_tag>(points, 6, CGAL::parameters::point_map(PointMap()));
  CGAL::get_default_random() = CGAL::Random(0);  // which the function may use
  PoissonFunction function(points.begin(), points.end(), PointMap(), NormalMap());
  const bool solved = function.compute_implicit_function();
  heed_scope();
  // CGAL's mesher goes by addresses in memory; the function does not.
  Sampled sampled = solved ? sample_function(function, spacing) : Sampled{};
  if (!drop_empty_parts(points, sampled)) {
    refuse(file, "expected points that lie on a closed surface", "points through which none was found", "give normals in the file, or points without large gaps");
  }
  fill_cavities(sampled.field);
  Mesh out = surface_of_grid(sampled.field, executor);
  for (Vec3& p : out.position) p = sampled.first + sampled.step * p;
  repair.points_rms = rms_distance(points, out) / diagonal_of(points);
  return out;
}

}  // namespace supple::fit
