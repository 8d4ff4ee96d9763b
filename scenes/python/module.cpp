/// The Python module `supple._supple`: converts and calls; nothing lives here that a user of the library lacks.
#include "bindings.h"

PYBIND11_MODULE(_supple, module) {
  namespace py = pybind11;
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
  python::bind_contacts(module, simulation);
  python::bind_surfaces(module, simulation);
  module.attr("__name__") = own_name;
}
