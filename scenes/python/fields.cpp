#include "fields.h"

#include <pybind11/stl.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "arrays.h"
#include "supple/core/counted.h"
#include "supple/core/error.h"
#include "supple/core/parts.h"
#include "supple/implicit/polygonise.h"
#include "supple/scenes/read_scene.h"

namespace supple::python {
namespace {

/// @throws Error{Usage}
[[noreturn]] void refuse(std::string place, std::string expected, std::string found) {
  throw Error(ErrorKind::Usage, Fault{.place = std::move(place), .key = {}, .expected = std::move(expected), .found = std::move(found), .hint = {}});
}

/// Poses with other positions and orientations, where they are given.
std::vector<Pose> moved(std::vector<Pose> pose, const py::object& position, const py::object& orientation) {
  const auto expect_all = [&](const char* argument, std::size_t found) {
    if (found != pose.size()) refuse(argument, "expected " + counted(pose.size(), "row") + ", one per part", std::to_string(found));
  };
  if (!position.is_none()) {
    const std::vector<Vec3> rows = rows3(position, "position");
    expect_all("position", rows.size());
    for (std::size_t k = 0; k < rows.size(); ++k) pose[k].position = rows[k];
  }
  if (!orientation.is_none()) {
    const std::vector<Quat> rows = rows4(orientation, "orientation");
    expect_all("orientation", rows.size());
    for (std::size_t k = 0; k < rows.size(); ++k) {
      if (!(rows[k].norm() > 0.0)) refuse("orientation", "expected quaternions of a length > 0", "a zero one in row " + std::to_string(k));
      pose[k].orientation = rows[k].normalized();
    }
  }
  return pose;
}

Field make_field(const py::object& object, const py::object& position, const py::object& orientation) {
  const auto text = py::module_::import("supple._scenes").attr("scene_of_object")(object).cast<std::string>();
  const scenes::Simulation simulation = [&] {
    const py::gil_scoped_release others_run;
    return scenes::Simulation(scenes::parse_scene(text, "object", "."), {.questions = true});
  }();
  if (simulation.bodies().size() != 1) {
    refuse("object", "expected an object that is one body", std::to_string(simulation.bodies().size()) + " bodies");
  }
  const scenes::Body& body = simulation.bodies().front();
  if (body.skeleton.primitive.empty()) refuse("object", "expected an object with a skeleton", "none");
  std::vector<Pose> pose;
  core::gather_poses(simulation.state().particles, body.particle, pose);
  return {std::make_shared<collision::SoftBody>(body.skeleton, simulation.model().objects[body.object].material, moved(std::move(pose), position, orientation))};
}

std::vector<Vec3> positions(const Field& f) {
  std::vector<Vec3> out;
  for (const Pose& pose : f.body->pose()) out.push_back(pose.position);
  return out;
}

std::vector<Quat> orientations(const Field& f) {
  std::vector<Quat> out;
  for (const Pose& pose : f.body->pose()) out.push_back(pose.orientation);
  return out;
}

py::tuple evaluate(const Field& f, const py::object& points) {
  const std::vector<Vec3> at = rows3(points, "points");
  std::vector<double> values(at.size());
  std::vector<Vec3> gradients(at.size());
  {
    const py::gil_scoped_release others_run;
    f.body->field().evaluate(at, values, gradients);
  }
  return py::make_tuple(own(std::move(values)), own(std::move(gradients)));
}

std::shared_ptr<Mesh> mesh_of(const Field& f, int cells) {
  if (cells <= 0) throw py::value_error("cells: expected a number > 0");
  const py::gil_scoped_release others_run;
  const Box box = f.body->field().surface_box();
  if (box.empty()) return std::make_shared<Mesh>();
  return std::make_shared<Mesh>(implicit::polygonise(f.body->field(), {.origin = Vec3::Zero(), .cell = box.extent().maxCoeff() / cells}, Executor()));
}

}  // namespace

void bind_fields(py::module_& module) {
  py::class_<Field>(module, "Field", "The implicit surface of a body that needs no scene: F > 0 inside, F = 0 on the surface.")
      .def(py::init(&make_field), py::arg("object"), py::kw_only(), py::arg("position") = py::none(), py::arg("orientation") = py::none(),
           "object       a mapping with the keys of an entry of `objects` in scene files: particles, skeleton, blend, iso, contact\n"
           "position     of its particles [m], shape (parts, 3); default: those of `object`\n"
           "orientation  quaternions x, y, z, w, shape (parts, 4)\n\n"
           "Raises Error for keys and values that scene files do not allow, either.")
      .def_property_readonly("position", [](const Field& f) { return own(positions(f)); }, "Positions of the parts [m], shape (parts, 3).")
      .def_property_readonly(
          "orientation", [](const Field& f) { return own(orientations(f)); }, "Quaternions x, y, z, w that map the axes of the parts to the world's, shape (parts, 4).")
      .def(
          "move", [](Field& f, const py::object& position, const py::object& orientation) { f.body->move(moved(f.body->pose(), position, orientation)); },
          py::arg("position") = py::none(), py::arg("orientation") = py::none(), "Moves the parts; what is not given stays.")
      .def("evaluate", &evaluate, py::arg("points"),
           "Values F, shape (n,), and gradients [1/m], shape (n, 3), at points [m], shape (n, 3). The outward normal is -gradient / |gradient|.")
      .def("mesh", &mesh_of, py::arg("cells") = 64, "A mesh of the surface, with this number of cells along its longest side.")
      .def("__repr__", [](const Field& f) { return "<supple.Field, " + counted(f.body->pose().size(), "part") + ">"; });
}

}  // namespace supple::python
