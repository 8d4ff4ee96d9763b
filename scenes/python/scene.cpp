#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "arrays.h"
#include "supple/core/counted.h"
#include "supple/core/hash.h"
#include "supple/scenes/query.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"

namespace supple::python {
namespace {

using scenes::Scene;

std::vector<std::string> override_texts(const py::object& overrides) {
  return py::module_::import("supple._overrides").attr("texts")(overrides).cast<std::vector<std::string>>();
}

using Paths = std::vector<std::filesystem::path>;

Scene read(const std::filesystem::path& path, const py::object& overrides, const Paths& allowed) {
  const std::vector<std::string> texts = override_texts(overrides);
  const py::gil_scoped_release others_run;
  return scenes::read_scene(path, texts, allowed);
}

Scene parse(const std::string& text, const py::object& overrides, const std::filesystem::path& folder,
            const std::string& name, const Paths& allowed) {
  const std::vector<std::string> texts = override_texts(overrides);
  const py::gil_scoped_release others_run;
  return scenes::parse_scene(text, name, folder, texts, allowed);
}

/// From a mapping with the keys of a scene file.
Scene make(const py::object& description, const py::object& overrides, const std::filesystem::path& folder, const std::string& name,
           const Paths& allowed) {
  return parse(py::module_::import("supple._scenes").attr("scene_text")(description).cast<std::string>(), overrides, folder, name, allowed);
}

py::tuple recipe_of(const Scene& scene) {
  const scenes::SceneSource* const source = scenes::source_of(scene);
  if (source == nullptr) throw py::type_error("this scene was not read, so it cannot be pickled");
  return py::make_tuple(source->text, source->name, source->folder, source->overrides, source->allowed);
}

Scene scene_of(const py::tuple& recipe) {
  const auto overrides = recipe[3].cast<std::vector<std::string>>();
  return scenes::parse_scene(recipe[0].cast<std::string>(), recipe[1].cast<std::string>(), recipe[2].cast<std::filesystem::path>(), overrides,
                             recipe[4].cast<Paths>());
}

std::vector<std::string> check(const Scene& scene) {
  const py::gil_scoped_release others_run;
  scenes::check_pictures(scene);
  return scenes::Simulation(scene).warnings();
}

std::string explain(const Scene& scene) {
  const py::gil_scoped_release others_run;
  scenes::Simulation simulation(scene, {.questions = true});
  return scenes::explain(simulation);
}

std::vector<std::string> object_names(const Scene& scene) {
  std::vector<std::string> names;
  for (const scenes::ObjectDesc& object : scene.objects) names.push_back(object.name);
  return names;
}

}  // namespace

void bind_scene(py::module_& module) {
  py::class_<Scene, std::shared_ptr<Scene>>(
      module, "Scene", "The checked content of a scene. It is immutable; to change a value, make it again with overrides.")
      .def(py::init(&make), py::arg("description"), py::arg("overrides") = py::none(), py::kw_only(), py::arg("folder") = ".", py::arg("name") = "scene.yaml",
           py::arg("allowed") = Paths{},
           "From a mapping with the keys of scene files, whose values are numbers, texts such as \"5 cm\", lists, arrays and mappings.\n\n"
           "overrides  as in read_scene\nfolder     where files that the scene names are\nname       stands for a file in messages, and names outputs\nallowed    as in read_scene\n\n"
           "Raises Error with every fault, each with key, expectation, finding and hint.")
      .def(py::pickle(&recipe_of, &scene_of))
      .def("__copy__", [](const py::object& self) { return self; })
      .def("__deepcopy__", [](const py::object& self, const py::dict&) { return self; })
      .def_property_readonly("name", &scenes::scene_name, "File name without extension; output files have this name.")
      .def_property_readonly(
          "source", [](const Scene& s) { return s.source; }, "The file it was read from.")
      .def_property_readonly(
          "title", [](const Scene& s) { return s.title; }, "Title that the file gives.")
      .def_property_readonly(
          "duration", [](const Scene& s) { return s.duration; }, "[s]")
      .def_property_readonly(
          "frame_rate", [](const Scene& s) { return s.frame_rate; }, "[1/s]")
      .def_property_readonly("frame_count", &Scene::frame_count,
                             "Frames 1 to frame_count; frame n shows t = (n - 1) / frame_rate.")
      .def_property_readonly(
          "gravity", [](const Scene& s) { return vector(s.gravity); }, "[m/s^2], shape (3,)")
      .def_property_readonly("objects", &object_names,
                             "Names of the objects, sorted; particles are numbered in this order.")
      .def_property_readonly(
          "content_hash", [](const Scene& s) { return to_hex(s.content_hash); },
          "Hash of all keys that act on the motion; saved states belong to scenes of the same hash.")
      .def("__repr__", [](const Scene& s) {
        return "<supple.Scene '" + scenes::scene_name(s) + "', " + counted(s.objects.size(), "object") + ", " +
               counted(static_cast<std::size_t>(s.frame_count()), "frame") + ">";
      });

  module.def(
      "read_scene", &read, py::arg("path"), py::arg("overrides") = py::none(), py::kw_only(), py::arg("allowed") = Paths(),
      "Reads and checks a scene file.\n\n"
      "overrides  {\"objects.ball.particles.mass\": 2} or [\"objects.ball.particles.mass=2\"]: keys that are set before the "
      "checks, as by\n"
      "           `supple run --set`; objects by name. Values may be numbers, arrays, or texts such as \"5 cm\".\n"
      "allowed    files and folders outside the scene's folder that the scene may read, after links are resolved\n\n"
      "Raises Error with every fault of the file, each with place, key, expectation, finding and hint.");
  module.def("parse_scene", &parse, py::arg("text"), py::arg("overrides") = py::none(), py::kw_only(),
             py::arg("folder") = ".", py::arg("name") = "scene.yaml", py::arg("allowed") = Paths(),
             "As read_scene, from text. `name` stands for the file in messages; files that the scene names are read from "
             "`folder`.");
  module.def("check", &check, py::arg("scene"),
             "Checks what only building the simulation and its pictures shows. Returns warnings about the initial state as "
             "sentences. Raises Error\n"
             "where the scene cannot be simulated or drawn.");
  module.def("explain", &explain, py::arg("scene"),
             "The stages of a step, each with the reason it runs or not, as text.");
  module.def("scene_reference", &scenes::scene_reference, "All keys of scene files, as Markdown.");
  module.def("scene_json_schema", &scenes::scene_json_schema, "A JSON Schema of scene files, for editors.");
}

}  // namespace supple::python
