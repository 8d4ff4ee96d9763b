/// The Python module `supple._supple`: converts and calls; nothing lives here that a user of the library lacks.
#include "bindings.h"

PYBIND11_MODULE(_supple, module) {
  namespace python = supple::python;
  module.attr("__version__") = SUPPLE_VERSION;
  python::bind_errors(module);
  python::bind_scene(module);
  python::bind_particles(module);
  python::bind_simulation(module);
}
