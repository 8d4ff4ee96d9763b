/// Bodies that Python code owns.
#pragma once

#include <memory>

#include "bindings.h"
#include "supple/collision/soft_body.h"

namespace supple::python {

struct Field {
  std::shared_ptr<collision::SoftBody> body;
};

/// @pre bind_surfaces was called
void bind_fields(py::module_& module);

}  // namespace supple::python
