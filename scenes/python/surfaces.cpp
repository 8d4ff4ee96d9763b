#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <tuple>

#include "arrays.h"
#include "supple/core/counted.h"
#include "supple/core/error.h"
#include "supple/core/io/mesh_files.h"
#include "supple/scenes/pictures.h"
#include "supple/scenes/probe.h"

namespace supple::python {
namespace {

using Shared = std::shared_ptr<Mesh>;

py::array triangles(const Shared& mesh) {
  return view(mesh->triangle.empty() ? nullptr : mesh->triangle.front().data(), {std::ssize(mesh->triangle), 3},
              keep(mesh));
}

py::dict columns(const Shared& mesh) {
  py::dict out;
  for (const Mesh::Column& column : mesh->columns) out[py::str(column.name)] = view(column.values, keep(mesh));
  return out;
}

/// @throws Error{Usage} for another kind of file
void write_mesh(const Mesh& mesh, const std::filesystem::path& path) {
  const py::gil_scoped_release others_run;
  if (path.extension() == ".ply") return io::write_ply(path, mesh);
  if (path.extension() == ".obj") return io::write_obj(path, mesh);
  throw Error(ErrorKind::Usage, Fault{.place = "path",
                                      .key = {},
                                      .expected = "expected a .ply or .obj file",
                                      .found = '\'' + path.string() + '\'',
                                      .hint = {}});
}

py::dict meshes(Handle& handle) {
  std::vector<Mesh> all = handle.use([](scenes::Simulation& s) { return s.meshes(); });
  py::dict out;
  for (std::size_t i = 0; i < all.size(); ++i) {
    out[py::str(handle.fixed().model().objects[i].name)] = std::make_shared<Mesh>(std::move(all[i]));
  }
  return out;
}

py::tuple field(Handle& handle, const std::string& body, const py::object& points) {
  const std::vector<Vec3> at = rows3(points, "points");
  std::vector<double> values(at.size());
  std::vector<Vec3> gradients(at.size());
  handle.use(
      [&](scenes::Simulation& s) { scenes::evaluate_field(s, scenes::find_body(s, body), at, values, gradients); });
  return py::make_tuple(own(std::move(values)), own(std::move(gradients)));
}

py::array picture(Handle& handle, const std::optional<std::filesystem::path>& path, const std::string& camera,
                  const std::optional<std::pair<int, int>>& size, int threads) {
  scenes::PictureOptions options{.camera = camera, .threads = threads};
  if (size) std::tie(options.width, options.height) = *size;
  const auto image = std::make_shared<const render::Image>(handle.use([&](scenes::Simulation& s) {
    render::Image drawn = scenes::draw_picture(s, options);
    if (path) render::write_png(*path, drawn);
    return drawn;
  }));
  return view(image->pixels.data(), {image->height, image->width, 3}, keep(image));
}

}  // namespace

void bind_surfaces(py::module_& module, Simulation& simulation) {
  py::class_<MeshReport>(module, "MeshReport", "Measured properties of a mesh: closed, oriented, area, volume.")
      .def_readonly("closed", &MeshReport::closed, "Every edge has exactly two triangles.")
      .def_readonly("oriented", &MeshReport::oriented, "The two triangles of every edge have consistent orientation.")
      .def_readonly("euler_characteristic", &MeshReport::euler_characteristic, "Vertices - edges + triangles.")
      .def_readonly("components", &MeshReport::components, "Number of connected parts.")
      .def_readonly("area", &MeshReport::area, "Area [m^2].")
      .def_readonly("volume", &MeshReport::volume, "Volume [m^3] of a closed and oriented mesh.");
  py::class_<Mesh, Shared>(module, "Mesh",
                           "Triangle mesh of a surface, counter-clockwise seen from outside. Its arrays are views.")
      .def_property_readonly(
          "position", [](const Shared& m) { return view(m->position, keep(m)); }, "Vertex positions [m], shape (vertices, 3).")
      .def_property_readonly(
          "normal", [](const Shared& m) { return view(m->normal, keep(m)); }, "Unit outward normals, shape (vertices, 3).")
      .def_property_readonly("triangle", &triangles, "Vertex numbers, shape (triangles, 3).")
      .def_property_readonly(
          "columns", &columns,
          "Further values at the vertices, {name: array of shape (vertices,)}: for a body in contact \"contact\", > 0 on a "
          "contact surface,\n"
          "and the value that its look shows, e.g. \"pressure\" [Pa] for objects.NAME.look.colour_by=pressure.")
      .def(
          "inspect",
          [](const Mesh& m) {
            const py::gil_scoped_release others_run;
            return inspect(m);
          },
          "Measures the mesh: whether it is closed, its area and volume, as a MeshReport.")
      .def("write", &write_mesh, py::arg("path"), "Writes a .ply or .obj file.")
      .def("__repr__", [](const Mesh& m) {
        return "<supple.Mesh, " + counted(m.vertex_count(), "vertex", "vertices") + ", " +
               counted(m.triangle_count(), "triangle") + ">";
      });

  simulation
      .def("meshes", &meshes,
           "Meshes of the current surfaces, {object: Mesh}, deformed by contact; empty for an object without a skeleton. "
           "Where two objects touch,\n"
           "both meshes share the vertices of their contact surface.")
      .def_property(
          "cell", [](Handle& h) { return h.use([](const scenes::Simulation& s) { return s.cell(); }); },
          [](Handle& h, double cell) {
            if (!(cell > 0.0)) throw py::value_error("cell: expected a length > 0 [m]");
            h.use([&](scenes::Simulation& s) { s.set_cell(cell); });
          },
          "Edge of a lattice cell of meshes() [m], for objects without a cell of their own. May be set.")
      .def(
          "set_cells",
          [](Handle& h, int cells) {
            if (cells <= 0) throw py::value_error("cells: expected a number > 0");
            h.use([&](scenes::Simulation& s) { s.set_cells(cells); });
          },
          py::arg("cells"),
          "Sets the cell of all objects by the number of cells along the longest side of all surfaces.")
      .def("field", &field, py::arg("body"), py::arg("points"),
           "The undeformed field of a body at points [m], shape (n, 3): values (> 0 inside), shape (n,), and gradients "
           "[1/m], shape (n, 3).\n"
           "The outward normal is -gradient / |gradient|.")
      .def(
          "picture", &picture, py::arg("path") = py::none(), py::kw_only(), py::arg("camera") = "",
          py::arg("size") = py::none(), py::arg("threads") = 1,
          "Draws the current state as `supple run` does: 8-bit sRGB, shape (height, width, 3), rows from top to "
          "bottom.\n\n"
          "path     PNG file to write as well\ncamera   name of one of the scene's cameras; default: the first one\n"
          "size     (width, height) [pixel]; default: that of output.images\nthreads  number of threads of the path tracer; 0: all "
          "of the machine");
}

}  // namespace supple::python
