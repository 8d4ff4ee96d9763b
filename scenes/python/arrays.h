/// NumPy arrays over memory of the library.
#pragma once

#include <pybind11/numpy.h>

#include <memory>
#include <span>
#include <vector>

#include "bindings.h"
#include "supple/core/types.h"

namespace supple::python {

static_assert(sizeof(Vec3) == 3 * sizeof(double) && sizeof(Quat) == 4 * sizeof(double));

/// Keeps `owner` alive for as long as an array is.
template <class T>
py::capsule keep(std::shared_ptr<T> owner) {
  return py::capsule(new std::shared_ptr<T>(std::move(owner)), [](void* p) { delete static_cast<std::shared_ptr<T>*>(p); });
}

/// A read-only array of this shape over memory that `base` keeps alive.
template <class T>
py::array view(const T* data, std::vector<py::ssize_t> shape, const py::handle& base) {
  py::array_t<T> array(std::move(shape), data, base);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}
inline py::array view(std::span<const double> v, const py::handle& base) { return view(v.data(), {std::ssize(v)}, base); }
inline py::array view(std::span<const std::uint8_t> v, const py::handle& base) { return view(v.data(), {std::ssize(v)}, base); }
inline py::array view(std::span<const std::uint32_t> v, const py::handle& base) { return view(v.data(), {std::ssize(v)}, base); }
inline py::array view(std::span<const Vec3> v, const py::handle& base) {
  return view(v.empty() ? nullptr : v.front().data(), {std::ssize(v), 3}, base);
}
inline py::array view(std::span<const Quat> v, const py::handle& base) {
  return view(v.empty() ? nullptr : v.front().coeffs().data(), {std::ssize(v), 4}, base);
}

/// An array that owns the values.
template <class T>
py::array own(std::vector<T> values) {
  const auto owner = std::make_shared<std::vector<T>>(std::move(values));
  return view(std::span<const T>(*owner), keep(owner));
}

/// Rows of three or four numbers from anything that NumPy can make an array of.
/// @throws Error{Usage} naming the argument, for another shape
std::vector<Vec3> rows3(const py::object& values, const char* argument);
std::vector<Quat> rows4(const py::object& values, const char* argument);
inline py::array vector(const Vec3& v) { return py::array_t<double>(3, v.data()); }

}  // namespace supple::python
