#include <cerrno>
#include <filesystem>
#include <system_error>

#include "bindings.h"
#include "supple/core/error.h"

namespace supple::python {
namespace {

const char* kind_name(ErrorKind kind) {
  switch (kind) {
    case ErrorKind::Usage:
      return "usage";
    case ErrorKind::Scene:
      return "scene";
    case ErrorKind::Io:
      return "io";
    case ErrorKind::Diverged:
      return "diverged";
    case ErrorKind::Limit:
      return "limit";
    case ErrorKind::Corrupt:
      return "corrupt";
    case ErrorKind::Internal:
      break;
  }
  return "internal";
}

void raise(const char* type, const py::tuple& arguments) {
  const py::object error_type = py::module_::import("supple._errors").attr(type);
  PyErr_SetObject(error_type.ptr(), error_type(*arguments).ptr());
}

/// Messages may quote bytes of files that are no text.
py::str text(const std::string& bytes) {
  return py::reinterpret_steal<py::str>(PyUnicode_DecodeUTF8(bytes.data(), std::ssize(bytes), "backslashreplace"));
}

}  // namespace

void bind_errors(py::module_& /*module*/) {
  py::register_exception_translator([](std::exception_ptr thrown) {  // NOLINT: pybind11 needs this signature
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const Error& error) {
      py::list faults;
      for (const Fault& f : error.faults()) {
        faults.append(py::make_tuple(text(f.place), text(f.key), text(f.expected), text(f.found), text(f.hint)));
      }
      raise("Error",
            py::make_tuple(text(error.what()), kind_name(error.kind()), static_cast<int>(error.kind()), faults));
    } catch (const ContractViolation& error) {
      raise("ContractViolation", py::make_tuple(text(error.what())));
    } catch (const std::filesystem::filesystem_error& error) {
      errno = error.code().value();
      PyErr_SetFromErrnoWithFilename(PyExc_OSError, error.path1().c_str());
    }
  });
}

}  // namespace supple::python
