#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <chrono>

#include "arrays.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/scenes/query.h"
#include "supple/scenes/run.h"

namespace supple::python {
namespace {

using scenes::Scene;
using Shared = std::shared_ptr<Handle>;

/// A state apart from its simulation, and which scene it belongs to.
struct SavedState {
  scenes::State state;
  scenes::StateOrigin origin;
};

/// Lets `slice(simulation, go_on)` work until it returns true, or cancel() was called. Between slices, which end at a
/// step, other threads get their turn and signals are seen.
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

/// What `for frame in simulation.frames()` goes through.
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
                        .hint = "adopt() goes on from states of scenes with other numbers"});
    }
    simulation.restore(saved.state);
  });
}

void bind_results(py::module_& module) {
  py::class_<scenes::Energies>(module, "Energies", "Energies of a state [J].")
      .def_readonly("kinetic", &scenes::Energies::kinetic, "Of all particles.")
      .def_readonly("interaction", &scenes::Energies::interaction, "Of the laws between particles.")
      .def_readonly("contact", &scenes::Energies::contact, "Of compression, springs of friction included.")
      .def_property_readonly("total", &scenes::Energies::total, "Sum of the three.")
      .def("__repr__", [](const scenes::Energies& e) {
        return py::str("Energies(kinetic={!r}, interaction={!r}, contact={!r})")
            .format(e.kinetic, e.interaction, e.contact);
      });

  using scenes::Audits;
  py::class_<Audits>(module, "Audits", "Relative errors since frame 1, the largest seen at a frame so far.")
      .def_readonly("momentum_error", &Audits::momentum_error, "Over the largest sum of m |v| [1].")
      .def_readonly("angular_momentum_error", &Audits::angular_momentum_error,
                    "Over the largest sum of |x - c| m |v| + |L| [1].")
      .def_readonly("energy_error", &Audits::energy_error, "Over the largest total energy [1].")
      .def_readonly("energy_returned", &Audits::energy_returned,
                    "What damping and friction gave back, over the same [1].")
      .def_readonly("contact_residual", &Audits::contact_residual,
                    "Largest difference of the two pressures on a contact surface, relative [1].")
      .def_readonly("largest_overlap", &Audits::largest_overlap, "Of the undeformed bodies [m].")
      .def_readonly("largest_overlap_share", &Audits::largest_overlap_share,
                    "Over the thickness of the thinner body [1].")
      .def("__repr__", [](const Audits& a) {
        return py::str(
                   "Audits(momentum_error={:.3g}, angular_momentum_error={:.3g}, energy_error={:.3g}, "
                   "largest_overlap={:.3g})")
            .format(a.momentum_error, a.angular_momentum_error, a.energy_error, a.largest_overlap);
      });

  using core::Ledger;
  py::class_<Ledger>(module, "Ledger", "What crossed the border of the system since frame 1.")
      .def_readonly("external_work", &Ledger::external_work, "Of loads, gravity and led obstacles [J].")
      .def_readonly("dissipated", &Ledger::dissipated, "Taken by friction and damping [J].")
      .def_property_readonly(
          "external_impulse", [](const Ledger& l) { return vector(l.external_impulse); }, "[N s], shape (3,)")
      .def_property_readonly(
          "external_angular_impulse", [](const Ledger& l) { return vector(l.external_angular_impulse); },
          "About the world origin [N m s], shape (3,)")
      .def_property_readonly(
          "pin_impulse", [](const Ledger& l) { return vector(l.pin_impulse); }, "[N s], shape (3,)")
      .def_property_readonly(
          "pin_angular_impulse", [](const Ledger& l) { return vector(l.pin_angular_impulse); },
          "About the world origin [N m s], shape (3,)");

  using core::Motion;
  py::class_<Motion>(module, "Motion", "Kinetic energy and momenta of all particles.")
      .def_readonly("kinetic_energy", &Motion::kinetic_energy, "[J]")
      .def_property_readonly(
          "momentum", [](const Motion& m) { return vector(m.momentum); }, "[N s], shape (3,)")
      .def_property_readonly(
          "angular_momentum", [](const Motion& m) { return vector(m.angular_momentum); },
          "About the world origin [N m s], shape (3,)");

  py::class_<SavedState>(module, "State",
                         "All that is needed to continue with the same bits; a copy that later steps leave alone.")
      .def_property_readonly(
          "frame", [](const SavedState& s) { return s.state.frame; }, "The last frame reached.")
      .def_property_readonly(
          "steps", [](const SavedState& s) { return s.state.steps; }, "Steps since the start.")
      .def_property_readonly(
          "state_hash", [](const SavedState& s) { return to_hex(s.state.hash()); }, "As that of the simulation.")
      .def(
          "save",
          [](const SavedState& s, const std::filesystem::path& path) {
            const py::gil_scoped_release others_run;
            scenes::save_state(path, s.state, s.origin);
          },
          py::arg("path"), "Writes a checkpoint file, the same as `supple run` leaves in states/.")
      .def("__repr__", [](const SavedState& s) {
        return "<supple.State, frame " + std::to_string(s.state.frame) + ", " + to_hex(s.state.hash()) + ">";
      });

  py::class_<Frames>(module, "Frames", "Goes through the frames of a simulation.")
      .def("__iter__", [](py::object self) { return self; })
      .def("__next__", &Frames::next);
}

}  // namespace

Simulation bind_simulation(py::module_& module) {
  bind_results(module);
  Simulation simulation(module, "Simulation",
                        "A scene in motion. Asking for meshes, contacts, pictures or energies never changes a later "
                        "state, and the number of threads changes\n"
                        "no bit.\n\n"
                        "Long calls let other Python threads run, and calls from several threads wait for each other, "
                        "which those that step let happen between two steps.\n"
                        "Control-C ends a call at a step; the simulation can go on from there.");
  simulation
      .def(py::init([](const Scene& scene, int threads, bool profile) {
             const py::gil_scoped_release others_run;
             return std::make_shared<Handle>(scene, scenes::SimulationOptions{.threads = threads, .profile = profile});
           }),
           py::arg("scene"), py::kw_only(), py::arg("threads") = 1, py::arg("profile") = false,
           "threads  0: all the machine has\nprofile  time every call of every stage, not a sample of them\n\n"
           "Raises Error where the scene cannot be simulated.")
      .def_property_readonly(
          "scene", [](const Handle& h) -> const Scene& { return h.fixed().scene(); }, "What it was made from.")
      .def_property_readonly("frame", &frame_of, "The last frame reached; 1 at the start.")
      .def_property_readonly(
          "time", [](Handle& h) { return h.use([](const scenes::Simulation& s) { return s.time(); }); }, "[s]")
      .def_property_readonly(
          "time_step", [](Handle& h) { return h.use([](const scenes::Simulation& s) { return s.time_step(); }); },
          "Of the current frame interval [s].")
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
          "Which rows of the particles each object has: {name: slice}.")
      .def_property_readonly(
          "bodies",
          [](Handle& h) {
            return h.use([](const scenes::Simulation& s) {
              std::vector<std::string> names;
              for (const scenes::Body& body : s.bodies()) names.push_back(body.name);
              return names;
            });
          },
          "Names of what has a surface of its own: objects, or the pieces that they broke into (\"plate.1\", ...); then the groups of a "
          "blending graph that touch each other (\"hand.group2\", ...).")
      .def_property_readonly(
          "fixed_bodies",
          [](const Handle& h) {
            std::vector<std::string> names;
            for (const scenes::FixedBody& body : h.fixed().model().fixed) names.push_back(body.name);
            return names;
          },
          "Names of what objects touch and nothing moves: \"ground\", if it collides, and the obstacles.")
      .def_property_readonly(
          "warnings", [](Handle& h) { return h.use([](const scenes::Simulation& s) { return s.warnings(); }); },
          "What is odd about the scene, as sentences.")
      .def_property_readonly(
          "integrator", [](const Handle& h) { return h.fixed().integrator().reason; },
          "How the scene is integrated, and why.")

      .def("step", &step, py::arg("count") = 1,
           "One time step, or `count` of them. Raises Error of kind \"diverged\" when the numbers leave their bounds; "
           "the simulation is then\n"
           "back at the last frame.")
      .def(
          "step_frame", [](Handle& h) { advance_to(h, frame_of(h) + 1); },
          "Steps to the next frame, also past the last one of the scene.")
      .def("advance_to", &advance_to, py::arg("frame"), "Steps to a frame. False where cancel() ended the call before.")
      .def(
          "frames",
          [](Shared h, std::optional<int> last) {
            const int count = h->fixed().scene().frame_count();
            return Frames{std::move(h), last.value_or(count)};
          },
          py::arg("last") = py::none(),
          "for frame in simulation.frames(): the present frame, then each one reached, to `last` or the scene's last "
          "one. cancel() ends it.")
      .def(
          "cancel", [](Handle& h) { h.cancelled = true; },
          "From another thread: ends the stepping call that is running, after the step it is at. Without one nothing "
          "happens.")
      .def("state", &copy_state, "A copy of the state, for restore() or to save.")
      .def("restore", &restore, py::arg("state"),
           "Continues from a state of the same scene, with the same bits as the run it is from.")
      .def(
          "adopt",
          [](Handle& h, const SavedState& saved) { h.use([&](scenes::Simulation& s) { s.adopt(saved.state); }); },
          py::arg("state"),
          "Continues from a state of a scene with other numbers (masses, stiffnesses, friction, loads), which act from "
          "now on; ledger and\n"
          "audits begin here. Velocities and angular momenta are those of the state. The objects and their particles "
          "must be the same.")
      .def(
          "save",
          [](Handle& h, const std::filesystem::path& path) {
            h.use([&](const scenes::Simulation& s) { scenes::save_state(path, s.state(), scenes::origin_of(s.scene())); });
          },
          py::arg("path"), "Writes a checkpoint file, the same as `supple run` leaves in states/.")
      .def(
          "load",
          [](Handle& h, const std::filesystem::path& path) {
            h.use([&](scenes::Simulation& s) { s.restore(scenes::load_state(path, scenes::origin_of(s.scene()))); });
          },
          py::arg("path"),
          "Continues from a checkpoint file. Raises Error of kind \"corrupt\" when it is not exactly what was written, "
          "or is of another scene.")

      .def(
          "energies", [](Handle& h) { return h.use([](scenes::Simulation& s) { return s.energies(); }); },
          "Energies of the current state.")
      .def(
          "audits", [](Handle& h) { return h.use([](const scenes::Simulation& s) { return s.audits(); }); },
          "How well momenta and energy are kept.")
      .def(
          "ledger", [](Handle& h) { return h.use([](const scenes::Simulation& s) { return s.state().ledger; }); },
          "Work, heat and impulses that went in and out so far.")
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
          "Pairs that pressed harder than half of what they can hold, as dictionaries: bodies a and b, the first time "
          "[s], energy of\n"
          "approach and contact at worst [J], and capacity [J].")
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
          "Work by stage so far: calls, CPU time [s], and how many pairs, primitives, samples ... were looked at, of "
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
