/// The Python module `supple._supple`: converts arguments and calls the library.
#include <string>

#include "bindings.h"
#include "fields.h"

namespace {

/// pybind11 before 2.12 reads the arrays of NumPy 2 by the layout of NumPy 1: numbers would be wrong without a message.
void check_numpy(const pybind11::module_& module) {
  const auto version = pybind11::module_::import("numpy").attr("__version__").cast<std::string>();
  constexpr bool kKnowsTwo = PYBIND11_VERSION_HEX >= 0x020C0000;
  module.attr("_numpy_versions") = kKnowsTwo ? "1 or later" : "1";
  if (kKnowsTwo || version.starts_with("1.")) return;
  throw pybind11::import_error(
      "supple was built with pybind11 " PYBIND11_TOSTRING(PYBIND11_VERSION_MAJOR) "." PYBIND11_TOSTRING(
          PYBIND11_VERSION_MINOR) ", which supports NumPy 1 only; found NumPy " +
      version +
      ". Build it with pybind11 2.12 or later, or use a Python that has NumPy 1 "
      "(Debian 12: -DPython_EXECUTABLE=/usr/bin/python3).");
}

}  // namespace

PYBIND11_MODULE(_supple, module) {
  namespace py = pybind11;
  check_numpy(module);
  namespace python = supple::python;
  module.attr("__version__") = SUPPLE_VERSION;
  // Users meet everything as supple.NAME, in signatures, too.
  const py::object own_name = module.attr("__name__");
  module.attr("__name__") = "supple";
  python::bind_errors(module);
  python::bind_scene(module);
  python::bind_runs(module);
  python::Simulation simulation = python::bind_simulation(module);
  python::bind_particles(module, simulation);
  python::bind_surfaces(module, simulation);
  python::bind_fields(module);
  python::bind_contacts(module, simulation);
  module.attr("__name__") = own_name;
}
