#include "arrays.h"
#include "supple/core/error.h"

namespace supple::python {
namespace {

using core::ParticleSet;
using core::ParticleState;

/// The particles of a simulation.
struct Particles {
  std::shared_ptr<Handle> of;
};

/// Arrays keep their addresses for the life of a simulation; only reading an address waits for other calls.
template <auto member>
py::array state_view(const Particles& p) {
  const auto rows =
      p.of->use([](const scenes::Simulation& simulation) { return std::span(simulation.state().particles.*member); });
  return view(rows, keep(p.of));
}
template <auto member>
py::array set_view(const Particles& p) {
  return view(p.of->fixed().model().particles.*member, keep(p.of));
}

py::array angular_velocities(const Particles& p) {
  return own(p.of->use([](scenes::Simulation& simulation) {
    const ParticleSet& set = simulation.model().particles;
    std::vector<Vec3> omega(set.size());
    for (std::size_t i = 0; i < set.size(); ++i)
      omega[i] = core::angular_velocity(set, simulation.state().particles, i);
    return omega;
  }));
}

/// Rows of `width` numbers, in the order of C. @throws Error{Usage} naming the argument
py::array_t<double> rows(const py::object& values, const char* argument, py::ssize_t width) {
  using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
  const Array array = Array::ensure(values);
  if (array && array.ndim() == 2 && array.shape(1) == width) return array;
  PyErr_Clear();
  const std::string found =
      array ? py::str(array.attr("shape")).cast<std::string>() : py::repr(py::type::of(values)).cast<std::string>();
  throw Error(ErrorKind::Usage, Fault{.place = argument,
                                      .key = {},
                                      .expected = "expected an array of shape (n, " + std::to_string(width) + ")",
                                      .found = array ? "shape " + found : found,
                                      .hint = {}});
}

void set_particles(Handle& handle, const py::object& position, const py::object& orientation,
                   const py::object& velocity, const py::object& angular_momentum, const py::object& angular_velocity) {
  scenes::ParticleChange change;
  if (!position.is_none()) change.position = rows3(position, "position");
  if (!orientation.is_none()) change.orientation = rows4(orientation, "orientation");
  if (!velocity.is_none()) change.velocity = rows3(velocity, "velocity");
  if (!angular_momentum.is_none()) change.angular_momentum = rows3(angular_momentum, "angular_momentum");
  if (!angular_velocity.is_none()) change.angular_velocity = rows3(angular_velocity, "angular_velocity");
  handle.use([&](scenes::Simulation& simulation) { simulation.set_particles(change); });
}

void set_loads(Handle& handle, const py::object& force, const py::object& torque) {
  core::Loads loads;
  if (!force.is_none()) loads.force = rows3(force, "force");
  if (!torque.is_none()) loads.torque = rows3(torque, "torque");
  if (force.is_none() != torque.is_none()) {
    (force.is_none() ? loads.force : loads.torque).assign(std::max(loads.force.size(), loads.torque.size()), Vec3::Zero());
  }
  handle.use([&](scenes::Simulation& simulation) { simulation.set_loads(loads); });
}

}  // namespace

std::vector<Vec3> rows3(const py::object& values, const char* argument) {
  const py::array_t<double> array = rows(values, argument, 3);
  std::vector<Vec3> out(static_cast<std::size_t>(array.shape(0)));
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = Eigen::Map<const Vec3>(array.data() + 3 * i);
  return out;
}

std::vector<Quat> rows4(const py::object& values, const char* argument) {
  const py::array_t<double> array = rows(values, argument, 4);
  std::vector<Quat> out(static_cast<std::size_t>(array.shape(0)));
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = Quat(Eigen::Map<const Eigen::Vector4d>(array.data() + 4 * i));
  return out;
}

void bind_particles(py::module_& module, Simulation& simulation) {
  py::class_<Particles>(module, "Particles",
                        "The particles of a simulation; row i is the same particle in every array. All arrays but "
                        "angular_velocity are views:\n"
                        "they cost nothing, follow the simulation and keep it alive, and cannot be written to "
                        "(Simulation.set_particles does\n"
                        "that). Copy data that must outlast the next step.")
      .def_property_readonly("position", &state_view<&ParticleState::position>,
                             "World position [m], shape (n, 3), a view.")
      .def_property_readonly("orientation", &state_view<&ParticleState::orientation>,
                             "Quaternion x, y, z, w, body to world, unit length, shape (n, 4), a view.")
      .def_property_readonly("velocity", &state_view<&ParticleState::velocity>, "World velocity [m/s], shape (n, 3), a view.")
      .def_property_readonly("angular_momentum", &state_view<&ParticleState::angular_momentum>,
                             "Angular momentum about the particle's centre, world axes [kg m^2/s], shape (n, 3), a view.")
      .def_property_readonly("angular_velocity", &angular_velocities, "Angular velocity, world axes [rad/s], shape (n, 3), computed.")
      .def_property_readonly("mass", &set_view<&ParticleSet::mass>, "Mass [kg], shape (n,), a view.")
      .def_property_readonly("inertia", &set_view<&ParticleSet::inertia>,
                             "Principal moments, body axes [kg m^2], shape (n, 3), a view.")
      .def_property_readonly("normal", &set_view<&ParticleSet::normal>,
                             "The fixed unit vector of each particle, body axes, shape (n, 3), a view.")
      .def_property_readonly("object", &set_view<&ParticleSet::object>,
                             "Number of the particle's object in Scene.objects, shape (n,), a view.")
      .def_property_readonly(
          "pinned", &set_view<&ParticleSet::pinned>,
          "Sum of 1: position held, 2: orientation held, 4: moves in its plane z = const; shape (n,), a view.")
      .def("__len__", [](const Particles& p) { return p.of->fixed().model().particles.size(); })
      .def("__repr__", [](const Particles& p) {
        return "<supple.Particles, " + std::to_string(p.of->fixed().model().particles.size()) + ">";
      });

  simulation
      .def_property_readonly(
          "particles", [](std::shared_ptr<Handle> h) { return Particles{std::move(h)}; }, "The particles, as views.")
      .def("set_particles", &set_particles, py::kw_only(), py::arg("position") = py::none(),
           py::arg("orientation") = py::none(), py::arg("velocity") = py::none(),
           py::arg("angular_momentum") = py::none(), py::arg("angular_velocity") = py::none(),
           "Sets positions, orientations or velocities of all particles between two steps; what is not given stays. Shapes and units "
           "are those of Particles;\n"
           "orientations are normalised, angular_velocity may replace angular_momentum, and what pins hold "
           "keeps no velocity.\n\n"
           "Changes of momentum, angular momentum and energy are booked in the ledger as external, so that the "
           "audits stay valid.")
      .def("set_loads", &set_loads, py::arg("force") = py::none(), py::arg("torque") = py::none(),
           "Sets forces [N] and torques [N m] on all particles, world axes, shape (n, 3), that act besides those of the scene from now on;\n"
           "without arguments none. For forces that change, call it before each step(). They are external loads: the ledger has their work\n"
           "and impulse. They are no part of the state: after restore() they still act, and a new Simulation has none.");
}

}  // namespace supple::python
