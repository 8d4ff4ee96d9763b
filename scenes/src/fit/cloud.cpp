#include "fit/cloud.h"

#define CGAL_EIGEN3_ENABLED
#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/IO/read_ply_points.h>
#include <CGAL/Random.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/compute_average_spacing.h>
#include <CGAL/grid_simplify_point_set.h>
#include <CGAL/jet_estimate_normals.h>
#include <CGAL/mst_orient_normals.h>
#include <CGAL/poisson_surface_reconstruction.h>
#include <CGAL/property_map.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "fit/data.h"
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
using SurfaceMesh = CGAL::Surface_mesh<Point>;

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

/// @return whether the file had them
bool complete_normals(const std::filesystem::path& file, std::vector<Oriented>& points) {
  const auto none = [](const Oriented& p) { return !(p.second.squared_length() > 0.0); };
  if (std::none_of(points.begin(), points.end(), none)) return true;
  CGAL::jet_estimate_normals<CGAL::Sequential_tag>(points, kNeighbours, kMaps);
  points.erase(CGAL::mst_orient_normals(points, kNeighbours, kMaps), points.end());
  if (points.size() < kFewest) refuse(file, "expected points that lie on a surface", "hardly any with a normal", "give normals in the file");
  return false;
}

double rms_distance(const std::vector<Oriented>& points, const SurfaceMesh& mesh) {
  using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, CGAL::AABB_face_graph_triangle_primitive<SurfaceMesh>>>;
  Tree tree(faces(mesh).begin(), faces(mesh).end(), mesh);
  double sum = 0.0;
  for (const Oriented& p : points) sum += tree.squared_distance(p.first);
  return std::sqrt(sum / static_cast<double>(points.size()));
}

}  // namespace

Mesh surface_through_points(const std::filesystem::path& file, double error, Repair& repair) {
  std::vector<Oriented> points = read_points(file);
  repair.points = points.size();
  thin_out(file, error, points);
  heed_scope();
  repair.normals_given = complete_normals(file, points);
  heed_scope();
  const double spacing = CGAL::compute_average_spacing<CGAL::Sequential_tag>(points, 6, CGAL::parameters::point_map(PointMap()));
  CGAL::get_default_random() = CGAL::Random(0);  // of the first points of the mesher
  SurfaceMesh mesh;
  constexpr double kAngle = 20.0, kRadius = 2.0, kDistance = 0.1;  // of triangles: least angle [deg], most size and distance from the surface over the spacing
  if (!CGAL::poisson_surface_reconstruction_delaunay(points.begin(), points.end(), PointMap(), NormalMap(), mesh, spacing, kAngle, kRadius, kDistance, CGAL::Manifold_tag()) || mesh.is_empty()) {
    refuse(file, "expected points that lie on a closed surface", "points through which none was found", "give normals in the file, or points without large gaps");
  }
  repair.points_rms = rms_distance(points, mesh) / diagonal_of(points);
  Mesh out;
  for (const auto v : mesh.vertices()) out.position.emplace_back(mesh.point(v).x(), mesh.point(v).y(), mesh.point(v).z());
  for (const auto f : mesh.faces()) {
    const auto h = mesh.halfedge(f);
    out.triangle.push_back({mesh.source(h), mesh.target(h), mesh.target(mesh.next(h))});
  }
  return out;
}

}  // namespace supple::fit
