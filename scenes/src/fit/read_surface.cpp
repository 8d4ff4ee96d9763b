#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/IO/OFF.h>
#include <CGAL/IO/OFF/File_header_OFF.h>
#include <CGAL/IO/STL.h>
#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/repair_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/triangulate_faces.h>
#include <CGAL/Polygon_mesh_processing/triangulate_hole.h>
#include <CGAL/Surface_mesh.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <sstream>

#include "fit/cloud.h"
#include "fit/data.h"
#include "fit/surface.h"
#include "fit/volume.h"
#include "supple/core/counted.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/io/read_mesh.h"

namespace supple::fit {
namespace {

namespace pmp = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using SurfaceMesh = CGAL::Surface_mesh<Point>;

constexpr double kMostClosed = 0.1;  // area of triangles that close holes, over the area of all

std::string text_of(const Point& p) {
  std::array<char, 96> text{};
  std::snprintf(text.data(), text.size(), "(%.6g, %.6g, %.6g)", p.x(), p.y(), p.z());
  return text.data();
}

struct Soup {
  std::vector<Point> points;
  std::vector<std::vector<std::size_t>> faces;
};

[[noreturn]] void refuse_format(const std::filesystem::path& file) {
  refuse(file, "expected a mesh", "text or bytes that are none, or that end early", "the extension says how a file is read");
}

/// OFF and STL by CGAL, from memory: its streams take a disk that fails for the end of a file.
Soup read_by_cgal(const std::filesystem::path& file, bool off) {
  const std::vector<std::byte> bytes = io::read_file(file, io::kLargestInput);
  const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  std::istringstream in(text);
  Soup soup;
  if (off) {
    std::istringstream start(text);
    CGAL::File_header_OFF header;
    // Memory is taken for as many as the header says.
    if (!(start >> header) || header.size_of_vertices() > bytes.size() || header.size_of_facets() > bytes.size()) refuse_format(file);
    if (!CGAL::IO::read_OFF(in, soup.points, soup.faces, CGAL::parameters::verbose(false))) refuse_format(file);
    return soup;
  }
  CGAL::IO::set_mode(in, CGAL::IO::BINARY);
  if (CGAL::IO::read_STL(in, soup.points, soup.faces, CGAL::parameters::verbose(false))) return soup;
  soup = {};
  std::istringstream again(text);
  CGAL::IO::set_mode(again, CGAL::IO::ASCII);
  if (!CGAL::IO::read_STL(again, soup.points, soup.faces, CGAL::parameters::verbose(false).use_binary_mode(false))) refuse_format(file);
  return soup;
}

Soup read_soup(const std::filesystem::path& file) {
  const std::string extension = extension_of(file);
  Soup soup;
  if (extension == ".off" || extension == ".stl") {
    soup = read_by_cgal(file, extension == ".off");
  } else {
    const Mesh mesh = io::read_mesh(file);
    for (const Vec3& p : mesh.position) soup.points.emplace_back(p.x(), p.y(), p.z());
    for (const auto& t : mesh.triangle) soup.faces.push_back({t[0], t[1], t[2]});
  }
  if (soup.faces.empty()) refuse(file, "expected triangles", "none", "points without faces are read from .xyz and .ply");
  for (const std::vector<std::size_t>& face : soup.faces) {
    for (const std::size_t corner : face) {
      if (corner >= soup.points.size()) refuse(file, "expected corners among the " + counted(soup.points.size(), "vertex", "vertices"), std::to_string(corner), "write the mesh again: a face names a vertex that is not there");
    }
  }
  for (const Point& p : soup.points) {
    if (!std::isfinite(p.x()) || !std::isfinite(p.y()) || !std::isfinite(p.z())) refuse(file, "expected finite coordinates", text_of(p), "remove vertices without a place");
  }
  return soup;
}

void expect_two_faces_at_edges(const std::filesystem::path& file, const Soup& soup) {
  std::map<std::pair<std::size_t, std::size_t>, int> faces;
  for (const std::vector<std::size_t>& face : soup.faces) {
    for (std::size_t k = 0; k < face.size(); ++k) {
      const std::size_t a = face[k], b = face[(k + 1) % face.size()];
      ++faces[std::minmax(a, b)];
    }
  }
  const auto many = [](const auto& edge) { return edge.second > 2; };
  const auto first = std::find_if(faces.begin(), faces.end(), many);
  if (first == faces.end()) return;
  refuse(file, "expected at most two triangles at every edge",
         counted(static_cast<std::size_t>(std::count_if(faces.begin(), faces.end(), many)), "edge") + " with more, one from " + text_of(soup.points[first->first.first]) + " to " +
             text_of(soup.points[first->first.second]),
         "remove walls inside, or join the parts into one solid");
}

void close_holes(const std::filesystem::path& file, SurfaceMesh& mesh, Repair& repair) {
  const double area = pmp::area(mesh);
  std::vector<SurfaceMesh::Halfedge_index> cycles;
  pmp::extract_boundary_cycles(mesh, std::back_inserter(cycles));
  double closed = 0.0;
  for (const SurfaceMesh::Halfedge_index cycle : cycles) {
    const Point at = mesh.point(mesh.source(cycle));
    std::vector<SurfaceMesh::Face_index> patch;
    pmp::triangulate_hole(mesh, cycle, std::back_inserter(patch), CGAL::parameters::use_delaunay_triangulation(true));
    if (patch.empty()) refuse(file, "expected a closed mesh", "a hole at " + text_of(at) + " that no triangles close", "close it in a mesh editor");
    closed += pmp::area(patch, mesh);
    ++repair.holes;
    if (closed > kMostClosed * (area + closed)) {
      refuse(file, "expected holes whose closing adds less than a tenth of the area", counted(cycles.size(), "hole") + ", the largest part at " + text_of(at),
             "close them in a mesh editor, or fit a surface without inside by --kind shell");
    }
  }
  repair.closed_area = closed / (area + closed);
}

/// @param which  of them is kept, counted from the largest
void keep_pieces(const std::filesystem::path& file, SurfaceMesh& mesh, Pieces pieces, std::uint32_t which, Repair& repair) {
  const auto [piece, fresh] = mesh.add_property_map<SurfaceMesh::Face_index, std::size_t>("f:piece", 0);
  const std::size_t count = pmp::connected_components(mesh, piece);
  repair.pieces = std::max(repair.pieces, count);  // what a volume had counts
  if (count < 2 && which == 1) return;
  if (pieces == Pieces::Refuse) refuse(file, "expected a mesh in one piece", std::to_string(count) + " pieces", kPiecesHint);
  std::vector<double> volume(count, 0.0);
  for (const SurfaceMesh::Face_index f : mesh.faces()) {
    const auto h = mesh.halfedge(f);
    const Point a = mesh.point(mesh.source(h)), b = mesh.point(mesh.target(h)), c = mesh.point(mesh.target(mesh.next(h)));
    volume[piece[f]] += CGAL::scalar_product(a - CGAL::ORIGIN, CGAL::cross_product(b - CGAL::ORIGIN, c - CGAL::ORIGIN)) / 6.0;
  }
  for (double& v : volume) v = std::abs(v);
  const std::vector<std::size_t> kept{piece_of(file, volume, which)};
  pmp::keep_connected_components(mesh, kept, piece);
  mesh.collect_garbage();
}

Mesh plain_mesh(const SurfaceMesh& mesh) {
  Mesh out;
  for (const SurfaceMesh::Vertex_index v : mesh.vertices()) out.position.emplace_back(mesh.point(v).x(), mesh.point(v).y(), mesh.point(v).z());
  for (const SurfaceMesh::Face_index f : mesh.faces()) {
    const auto h = mesh.halfedge(f);
    out.triangle.push_back({mesh.source(h), mesh.target(h), mesh.target(mesh.next(h))});
  }
  return out;
}

Soup soup_of(const Mesh& mesh) {
  Soup out;
  for (const Vec3& p : mesh.position) out.points.emplace_back(p.x(), p.y(), p.z());
  for (const auto& t : mesh.triangle) out.faces.push_back({t[0], t[1], t[2]});
  return out;
}

/// The surface of the data, as it is.
Soup read_data(const std::filesystem::path& file, const FitOptions& options, Repair& repair, const Executor& executor) {
  const DataKind kind = kind_of(file);
  if (kind != DataKind::Volume && options.volume.given()) refuse(file, "expected a volume, of which --iso, --window and --label choose a part", "another kind of data", "leave these options out", ErrorKind::Usage);
  if (kind == DataKind::Volume) {
    Volume volume = extension_of(file) == ".vdb" ? read_vdb(file) : read_image(file);
    return soup_of(surface_of_volume(file, std::move(volume), options, repair, executor));
  }
  if (kind == DataKind::Mesh) return read_soup(file);
  return soup_of(surface_through_points(file, options.error, repair, executor));
}

/// What a closed mesh encloses: less than 0 where its faces are turned inward, 0 where it is as good as flat. CGAL's own test of the orientation looks at the
/// highest vertex alone, and errs where faces go through each other there.
double enclosed_volume(const SurfaceMesh& mesh) {
  constexpr double kLeast = 1e-6;
  const double area = pmp::area(mesh), volume = pmp::volume(mesh);
  return std::abs(volume) > kLeast * area * std::sqrt(area) ? volume : 0.0;
}

}  // namespace

Mesh read_surface(const std::filesystem::path& file, const FitOptions& options, Repair& repair, const Executor& executor) {
  Soup soup = read_data(file, options, repair, executor);
  pmp::repair_polygon_soup(soup.points, soup.faces);
  expect_two_faces_at_edges(file, soup);
  pmp::orient_polygon_soup(soup.points, soup.faces);
  if (soup.faces.empty() || !pmp::is_polygon_soup_a_polygon_mesh(soup.faces)) refuse(file, "expected triangles that form a surface", "none", "repair the mesh in a mesh editor");
  SurfaceMesh mesh;
  pmp::polygon_soup_to_polygon_mesh(soup.points, soup.faces, mesh);
  pmp::triangulate_faces(mesh);
  const bool solid = options.kind == Kind::Solid;
  if (solid) close_holes(file, mesh, repair);
  // Of a volume one has been chosen.
  keep_pieces(file, mesh, options.pieces, kind_of(file) == DataKind::Volume || options.pieces == Pieces::Refuse ? 1 : options.piece, repair);
  const bool closed = CGAL::is_closed(mesh);
  const double volume = closed ? enclosed_volume(mesh) : 0.0;
  if (solid && closed && volume == 0.0) refuse(file, "expected a mesh that encloses a volume", "a flat one", "fit a surface without inside by --kind shell");
  repair.turned = volume < 0.0;
  if (repair.turned) pmp::reverse_face_orientations(mesh);
  repair.vertices = mesh.number_of_vertices();
  repair.triangles = mesh.number_of_faces();
  return plain_mesh(mesh);
}

}  // namespace supple::fit
