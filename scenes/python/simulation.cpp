#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <chrono>

#include "arrays.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/scenes/query.h"
#include "supple/scenes/run.h"
#include "supple/scenes/state_bytes.h"

namespace supple::python {
namespace {

using scenes::Scene;
using Shared = std::shared_ptr<Handle>;

/// A copy of a state, and the scene it belongs to.
struct SavedState {
  scenes::State state;
  scenes::StateOrigin origin;
};

/// Calls `slice(simulation, go_on)` until it returns true or cancel() is called. Between slices, which end at a
/// step, other threads get their turn and signals are handled.
template <class Slice>
bool in_slices(Handle& handle, const Slice& slice) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::milliseconds kSlice(50);
  handle.cancelled = false;
  for (;;) {
    const auto end = Clock::now() + kSlice;
    const auto go_on = [&] { return !handle.cancelled && Clock::now() < end; };
    const bool done = handle.use([&](scenes::Simulation& simulation) { return slice(simulation, go_on); });
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (done || handle.cancelled) return done;
  }
}

void step(Handle& handle, std::int64_t count) {
  in_slices(handle, [&](scenes::Simulation& simulation, const auto& go_on) {
    while (count > 0) {
      simulation.step();
      if (--count > 0 && !go_on()) return false;
    }
    return true;
  });
}

bool advance_to(Handle& handle, int frame) {
  return in_slices(
      handle, [&](scenes::Simulation& simulation, const auto& go_on) { return simulation.advance_to(frame, go_on); });
}

int frame_of(Handle& handle) {
  return handle.use([](const scenes::Simulation& simulation) { return simulation.frame(); });
}

/// The iterator of `for frame in simulation.frames()`.
struct Frames {
  Shared of;
  int last = 0;
  bool begun = false;

  int next() {
    const int now = frame_of(*of);
    const int wanted = begun ? now + 1 : now;
    begun = true;
    if (wanted > last || !advance_to(*of, wanted)) throw py::stop_iteration();
    return wanted;
  }
};

SavedState copy_state(Handle& handle) {
  return handle.use([](const scenes::Simulation& simulation) {
    return SavedState{simulation.state(), scenes::origin_of(simulation.scene())};
  });
}

void restore(Handle& handle, const SavedState& saved) {
  handle.use([&](scenes::Simulation& simulation) {
    if (saved.origin.scene != simulation.scene().content_hash) {
      throw Error(ErrorKind::Usage,
                  Fault{.place = "state",
                        .key = {},
                        .expected = "expected a state of this scene, " + to_hex(simulation.scene().content_hash),
                        .found = to_hex(saved.origin.scene),
                        .hint = "adopt() continues from states of scenes with other values"});
    }
    simulation.restore(saved.state);
  });
}

py::tuple pickled(const SavedState& saved) {
  const std::vector<std::byte> bytes = scenes::state_bytes(saved.state, saved.origin);
  return py::make_tuple(saved.origin.scene, saved.origin.keys ? *saved.origin.keys : std::string(),
                        py::bytes(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

SavedState unpickled(const py::tuple& parts) {
  const scenes::StateOrigin origin{parts[0].cast<std::uint64_t>(), std::make_shared<const std::string>(parts[1].cast<std::string>())};
  const auto bytes = parts[2].cast<std::string>();
  return {scenes::state_of_bytes("state", std::as_bytes(std::span(bytes)), origin), origin};
}

Shared simulation_at(const Scene& scene, int threads, bool profile, const scenes::State& state) {
  const py::gil_scoped_release others_run;
  auto handle = std::make_shared<Handle>(scene, scenes::SimulationOptions{.threads = threads, .profile = profile});
  handle->restore(state);
  return handle;
}

Shared copied(Handle& handle) { return simulation_at(handle.fixed().scene(), handle.threads(), handle.profile(), copy_state(handle).state); }

void bind_results(py::module_& module) {
  py::class_<scenes::Energies>(module, "Energies", "Energies of a state [J].")
      .def_readonly("kinetic", &scenes::Energies::kinetic, "Kinetic energy of all particles [J].")
      .def_readonly("interaction", &scenes::Energies::interaction, "Energy of the laws between particles [J].")
      .def_readonly("contact", &scenes::Energies::contact, "Energy of compression, springs of friction included [J].")
      .def_property_readonly("total", &scenes::Energies::total, "Sum of the three [J].")
      .def("__repr__", [](const scenes::Energies& e) {
        return py::str("Energies(kinetic={!r}, interaction={!r}, contact={!r})")
            .format(e.kinetic, e.interaction, e.contact);
      });

  using scenes::Audits;
  py::class_<Audits>(module, "Audits", "Relative conservation errors since frame 1; each is the largest at any frame so far.")
      .def_readonly("momentum_error", &Audits::momentum_error, "Error of the momentum over the largest sum of m |v| [1].")
      .def_readonly("angular_momentum_error", &Audits::angular_momentum_error,
                    "Error of the angular momentum over the largest sum of |x - c| m |v| + |L| [1].")
      .def_readonly("energy_error", &Audits::energy_error, "Error of the energy balance over the largest total energy [1].")
      .def_readonly("energy_returned", &Audits::energy_returned,
                    "Energy that damping and friction returned, over the largest total energy [1].")
      .def_readonly("contact_residual", &Audits::contact_residual,
                    "Largest difference of the two pressures on a contact surface, relative [1].")
      .def_readonly("largest_overlap", &Audits::largest_overlap, "Largest overlap of undeformed bodies [m].")
      .def_readonly("largest_overlap_share", &Audits::largest_overlap_share,
                    "Largest overlap over the thickness of the thinner body [1].")
      .def("__repr__", [](const Audits& a) {
        return py::str(
                   "Audits(momentum_error={:.3g}, angular_momentum_error={:.3g}, energy_error={:.3g}, "
                   "largest_overlap={:.3g})")
            .format(a.momentum_error, a.angular_momentum_error, a.energy_error, a.largest_overlap);
      });

  using core::Ledger;
  py::class_<Ledger>(module, "Ledger", "Work, heat and impulses that entered or left the system since frame 1.")
      .def_readonly("external_work", &Ledger::external_work, "Work of loads, gravity and obstacles moved by keys [J].")
      .def_readonly("dissipated", &Ledger::dissipated, "Energy dissipated by friction and damping [J].")
      .def_property_readonly(
          "external_impulse", [](const Ledger& l) { return vector(l.external_impulse); }, "Impulse of loads, gravity and obstacles [N s], shape (3,)")
      .def_property_readonly(
          "external_angular_impulse", [](const Ledger& l) { return vector(l.external_angular_impulse); },
          "About the world origin [N m s], shape (3,)")
      .def_property_readonly(
          "pin_impulse", [](const Ledger& l) { return vector(l.pin_impulse); }, "Impulse of the pins [N s], shape (3,)")
      .def_property_readonly(
          "pin_angular_impulse", [](const Ledger& l) { return vector(l.pin_angular_impulse); },
          "About the world origin [N m s], shape (3,)");

  using core::Motion;
  py::class_<Motion>(module, "Motion", "Kinetic energy and momenta of all particles.")
      .def_readonly("kinetic_energy", &Motion::kinetic_energy, "Kinetic energy [J]")
      .def_property_readonly(
          "momentum", [](const Motion& m) { return vector(m.momentum); }, "Momentum [N s], shape (3,)")
      .def_property_readonly(
          "angular_momentum", [](const Motion& m) { return vector(m.angular_momentum); },
          "About the world origin [N m s], shape (3,)");

  py::class_<SavedState>(module, "State",
                         "All that is needed to continue with the same bits. It is a copy, which later steps do not change.")
      .def(py::pickle(&pickled, &unpickled))
      .def("__copy__", [](const SavedState& s) { return s; })
      .def("__deepcopy__", [](const SavedState& s, const py::dict&) { return s; })
      .def_property_readonly(
          "frame", [](const SavedState& s) { return s.state.frame; }, "The last frame reached.")
      .def_property_readonly(
          "steps", [](const SavedState& s) { return s.state.steps; }, "Number of steps since the start.")
      .def_property_readonly(
          "state_hash", [](const SavedState& s) { return to_hex(s.state.hash()); }, "Hash of the state, equal to Simulation.state_hash at that time.")
      .def(
          "save",
          [](const SavedState& s, const std::filesystem::path& path) {
            const py::gil_scoped_release others_run;
            scenes::save_state(path, s.state, s.origin);
          },
          py::arg("path"), "Writes a saved-state file, as `supple run` does in states/.")
      .def("__repr__", [](const SavedState& s) {
        return "<supple.State, frame " + std::to_string(s.state.frame) + ", " + to_hex(s.state.hash()) + ">";
      });

  py::class_<Frames>(module, "Frames", "Iterates over the frames of a simulation.")
      .def("__iter__", [](py::object self) { return self; })
      .def("__next__", &Frames::next);
}

}  // namespace

Simulation bind_simulation(py::module_& module) {
  bind_results(module);
  Simulation simulation(module, "Simulation",
                        "A simulation of a scene. Reading meshes, contacts, pictures or energies never changes a later "
                        "state, and the number of threads does\n"
                        "not change results.\n\n"
                        "Long calls let other Python threads run. Calls from several threads wait for each other; "
                        "calls that step let others in between two steps.\n"
                        "Control-C ends a call after a step; the simulation can continue from there.");
  simulation
      .def(py::init([](const Scene& scene, int threads, bool profile) {
             const py::gil_scoped_release others_run;
             return std::make_shared<Handle>(scene, scenes::SimulationOptions{.threads = threads, .profile = profile});
           }),
           py::arg("scene"), py::kw_only(), py::arg("threads") = 1, py::arg("profile") = false,
           "threads  number of threads, 0: all of the machine\nprofile  measure the time of every call of every stage instead of a sample of the calls\n\n"
           "Raises Error where the scene cannot be simulated.")
      .def(py::pickle(
          [](Handle& h) { return py::make_tuple(Scene(h.fixed().scene()), h.threads(), h.profile(), copy_state(h)); },
          [](const py::tuple& parts) {
            return simulation_at(parts[0].cast<const Scene&>(), parts[1].cast<int>(), parts[2].cast<bool>(), parts[3].cast<const SavedState&>().state);
          }))
      .def("__copy__", &copied)
      .def("__deepcopy__", [](Handle& h, const py::dict&) { return copied(h); })
      .def_property_readonly(
          "scene", [](const Handle& h) -> const Scene& { return h.fixed().scene(); }, "The scene that is simulated.")
      .def_property_readonly("frame", &frame_of, "The last frame reached; 1 at the start.")
      .def_property_readonly(
          "time", [](Handle& h) { return h.use([](const scenes::Simulation& s) { return s.time(); }); }, "Present time [s].")
      .def_property_readonly(
          "time_step", [](Handle& h) { return h.use([](const scenes::Simulation& s) { return s.time_step(); }); },
          "Time step in the current frame interval [s].")
      .def_property_readonly(
          "state_hash",
          [](Handle& h) { return to_hex(h.use([](const scenes::Simulation& s) { return s.state_hash(); })); },
          "16 hexadecimal digits; equal states have equal hashes, and `supple run` reports the same ones.")
      .def_property_readonly(
          "objects",
          [](const Handle& h) {
            py::dict slices;
            for (const scenes::ObjectModel& o : h.fixed().model().objects)
              slices[py::str(o.name)] = py::slice(o.first, o.last, 1);
            return slices;
          },
          "Rows of the particles of each object: {name: slice}.")
      .def_property_readonly(
          "bodies",
          [](Handle& h) {
            return h.use([](const scenes::Simulation& s) {
              std::vector<std::string> names;
              for (const scenes::Body& body : s.bodies()) names.push_back(body.name);
              return names;
            });
          },
          "Names of the bodies: objects, or the pieces that they broke into (\"plate.1\", ...); then the groups of a "
          "blending graph that touch each other (\"hand.group2\", ...).")
      .def_property_readonly(
          "fixed_bodies",
          [](const Handle& h) {
            std::vector<std::string> names;
            for (const scenes::FixedBody& body : h.fixed().model().fixed) names.push_back(body.name);
            return names;
          },
          "Names of the solids that forces do not move: \"ground\", if it collides, and the obstacles.")
      .def_property_readonly(
          "warnings", [](Handle& h) { return h.use([](const scenes::Simulation& s) { return s.warnings(); }); },
          "Warnings about the scene and the run, as sentences.")
      .def_property_readonly(
          "integrator", [](const Handle& h) { return h.fixed().integrator().reason; },
          "Integration method of the scene, and the reason for it.")

      .def("step", &step, py::arg("count") = 1,
           "Takes `count` time steps. Raises Error of kind \"diverged\" when values leave their bounds; "
           "the simulation is then\n"
           "back at the last frame.")
      .def(
          "step_frame", [](Handle& h) { advance_to(h, frame_of(h) + 1); },
          "Steps to the next frame, also past the last one of the scene.")
      .def("advance_to", &advance_to, py::arg("frame"), "Steps to a frame. Returns False where cancel() ended the call earlier.")
      .def(
          "frames",
          [](Shared h, std::optional<int> last) {
            const int count = h->fixed().scene().frame_count();
            return Frames{std::move(h), last.value_or(count)};
          },
          py::arg("last") = py::none(),
          "Iterates: yields the present frame, then steps to each following one, up to `last` or the scene's last "
          "one. cancel() ends it.")
      .def(
          "cancel", [](Handle& h) { h.cancelled = true; },
          "Called from another thread: ends the running call after its present step. Without one nothing "
          "happens.")
      .def("state", &copy_state, "A copy of the state, for restore() or to save.")
      .def("restore", &restore, py::arg("state"),
           "Continues from a state of the same scene, with the same bits as the original run.")
      .def(
          "adopt",
          [](Handle& h, const SavedState& saved) { h.use([&](scenes::Simulation& s) { s.adopt(saved.state); }); },
          py::arg("state"),
          "Continues from a state of a scene with other values (masses, stiffnesses, friction, loads); this scene's values act from "
          "now on. Ledger and\n"
          "audits start anew. Velocities and angular momenta are those of the state. The objects and their particles "
          "must be the same.")
      .def(
          "save",
          [](Handle& h, const std::filesystem::path& path) {
            h.use([&](const scenes::Simulation& s) { scenes::save_state(path, s.state(), scenes::origin_of(s.scene())); });
          },
          py::arg("path"), "Writes a saved-state file, as `supple run` does in states/.")
      .def(
          "load",
          [](Handle& h, const std::filesystem::path& path) {
            h.use([&](scenes::Simulation& s) { s.restore(scenes::load_state(path, scenes::origin_of(s.scene()))); });
          },
          py::arg("path"),
          "Continues from a saved-state file. Raises Error of kind \"corrupt\" when it is damaged "
          "or belongs to another scene.")

      .def(
          "energies", [](Handle& h) { return h.use([](scenes::Simulation& s) { return s.energies(); }); },
          "Energies of the current state.")
      .def(
          "audits", [](Handle& h) { return h.use([](const scenes::Simulation& s) { return s.audits(); }); },
          "Conservation errors of momenta and energy so far.")
      .def(
          "ledger", [](Handle& h) { return h.use([](const scenes::Simulation& s) { return s.state().ledger; }); },
          "Work, heat and impulses that entered or left the system so far.")
      .def(
          "shape_errors",
          [](Handle& h) {
            const scenes::RunRecord record = h.use([](const scenes::Simulation& s) { return s.state().record; });
            py::dict out;
            for (std::size_t i = 0; i < record.objects.size(); ++i) {
              out[py::str(h.fixed().model().objects[i].name)] =
                  py::make_tuple(record.objects[i].final_shape_error, record.objects[i].largest_deformation);
            }
            return out;
          },
          "{object: (now, largest)} at the frames so far: RMS of its particles after the best rigid fit over its "
          "diameter at rest [1].")
      .def(
          "overloads",
          [](Handle& h) {
            py::list out;
            for (const auto& o : h.use([](const scenes::Simulation& s) { return s.state().record.overloads; })) {
              out.append(py::dict(py::arg("a") = o.a, py::arg("b") = o.b, py::arg("time") = o.time,
                                  py::arg("energy") = o.energy, py::arg("capacity") = o.capacity));
            }
            return out;
          },
          "Pairs whose energy of approach and contact exceeded half of their capacity, as dictionaries: bodies a and b, the first time "
          "[s], largest energy of\n"
          "approach and contact [J], and capacity [J].")
      .def(
          "motion",
          [](Handle& h) {
            return h.use([](const scenes::Simulation& s) {
              return core::measure_motion(s.model().particles, s.state().particles);
            });
          },
          "Kinetic energy and momenta of the current state.")
      .def(
          "profile",
          [](Handle& h) {
            const scenes::Profile profile = h.use([](const scenes::Simulation& s) { return s.profile(); });
            py::dict stages;
            for (const scenes::StageInfo& stage : scenes::stage_table()) {
              const scenes::StageProfile& p = profile[static_cast<std::size_t>(stage.stage)];
              stages[py::str(std::string(stage.name))] =
                  py::dict(py::arg("calls") = p.calls, py::arg("cpu_s") = p.cpu_s, py::arg("visited") = p.visited,
                           py::arg("present") = p.present);
            }
            return stages;
          },
          "Work by stage so far: calls, CPU time [s], and how many pairs, primitives or samples were visited, of "
          "those present.")
      .def(
          "explain", [](Handle& h) { return h.use([](scenes::Simulation& s) { return scenes::explain(s); }); },
          "The stages of a step, each with the reason it runs or not, and the contacts of the current state, as text.")
      .def("__repr__", [](Handle& h) {
        const auto [frame, time] = h.use([](const scenes::Simulation& s) { return std::pair(s.frame(), s.time()); });
        return py::str("<supple.Simulation '{}', frame {} of {}, t = {:.6g} s>")
            .format(scenes::scene_name(h.fixed().scene()), frame, h.fixed().scene().frame_count(), time);
      });
  return simulation;
}

}  // namespace supple::python
