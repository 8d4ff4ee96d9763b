#include <pybind11/stl.h>

#include "arrays.h"
#include "fields.h"
#include "supple/scenes/contact_report.h"
#include "supple/scenes/probe.h"

namespace supple::python {
namespace {

using collision::ContactSurface;
using scenes::ContactReport;
using Report = std::shared_ptr<const ContactReport>;

/// One pair of a report.
struct Pair {
  Report report;
  std::size_t index = 0;
  [[nodiscard]] const ContactReport::Pair& of() const { return report->pairs[index]; }
  [[nodiscard]] const ContactSurface::Summary& summary() const { return report->points.summary[index]; }
};

/// The contact of two bodies alone.
struct PairContact {
  std::string a, b;
  std::shared_ptr<const ContactSurface> surface;
  [[nodiscard]] ContactSurface::Summary summary() const {
    return surface->summary.empty() ? ContactSurface::Summary{} : surface->summary.front();
  }
};

struct Contacts {
  Report report;
};

/// The rows of a column of the report's points that are the pair's.
template <class T>
py::array rows(const Pair& pair, const std::vector<T>& column) {
  return view(std::span<const T>(column).subspan(pair.of().first, pair.of().last - pair.of().first), keep(pair.report));
}

/// Properties that ContactPair and PairContact have in common.
template <class Class>
void add_summary(Class& type) {
  using T = typename Class::type;
  type.def_property_readonly(
          "elastic_force", [](const T& p) { return vector(p.summary().force); },
          "Force on a, without damping and friction [N], shape (3,); b gets the opposite.")
      .def_property_readonly(
          "moment", [](const T& p) { return vector(p.summary().moment); },
          "Moment of elastic_force about the world origin [N m], shape (3,).")
      .def_property_readonly(
          "centre_of_pressure", [](const T& p) { return vector(p.summary().centre_of_pressure); }, "Centre of pressure [m], shape (3,)")
      .def_property_readonly(
          "area", [](const T& p) { return p.summary().area; }, "Area of the contact surface [m^2]")
      .def_property_readonly(
          "load", [](const T& p) { return p.summary().load; }, "Integral of the pressure over the contact surface [N].")
      .def_property_readonly(
          "energy", [](const T& p) { return p.summary().energy; }, "Energy of compression [J].")
      .def_property_readonly(
          "largest_pressure", [](const T& p) { return p.summary().largest_pressure; }, "Largest pressure [Pa]")
      .def_property_readonly(
          "largest_overlap", [](const T& p) { return p.summary().largest_overlap; }, "Largest overlap of the undeformed bodies [m].")
      .def_property_readonly(
          "error_estimate", [](const T& p) { return p.summary().error_estimate; },
          "Estimate of the relative error of elastic_force, area and centre_of_pressure, the largest of the three [1].")
      .def_property_readonly(
          "rule", [](const T& p) { return scenes::rule_name(p.summary().rule); },
          "Quadrature rule: \"polar\", \"march\" or \"panels\"; \"none\" where nothing touches.")
      .def_property_readonly(
          "patches", [](const T& p) { return p.summary().patches; }, "Number of contact patches.")
      .def_property_readonly(
          "evaluations", [](const T& p) { return p.summary().evaluations; }, "Number of field evaluations.");
}

void bind_pair(py::module_& module) {
  py::class_<Pair> pair(
      module, "ContactPair",
      "Two bodies in contact, and the quadrature points of their contact surface: sums over the points are integrals.");
  pair.def_property_readonly(
          "a", [](const Pair& p) { return p.of().a; }, "Name of the first body.")
      .def_property_readonly(
          "b", [](const Pair& p) { return p.of().b; }, "Name of the second body.")
      .def_property_readonly(
          "force", [](const Pair& p) { return vector(p.of().force); },
          "Force on a, damping and friction included [N], shape (3,); b gets the opposite.")
      .def_property_readonly(
          "dissipated_power", [](const Pair& p) { return p.of().dissipated_power; }, "Power dissipated by damping and friction [W].")
      .def_property_readonly(
          "dissipated_work", [](const Pair& p) { return p.of().dissipated_work; }, "Work dissipated by damping and friction since the start [J].")
      .def_property_readonly(
          "point", [](const Pair& p) { return rows(p, p.report->points.point); },
          "Positions [m], shape (points, 3), a view of the report.")
      .def_property_readonly(
          "normal", [](const Pair& p) { return rows(p, p.report->points.normal); },
          "Unit normals, out of a and into b, shape (points, 3), a view of the report.")
      .def_property_readonly(
          "point_area", [](const Pair& p) { return rows(p, p.report->points.area); },
          "Area that each point stands for [m^2], shape (points,), a view of the report.")
      .def_property_readonly(
          "pressure", [](const Pair& p) { return rows(p, p.report->points.pressure); },
          "Elastic pressure [Pa], shape (points,), a view of the report.")
      .def("__repr__", [](const Pair& p) {
        return py::str("<supple.ContactPair {} and {}, |force| = {:.4g} N, area = {:.4g} m^2, error estimate {:.1e}>")
            .format(p.of().a, p.of().b, p.of().force.norm(), p.of().area, p.of().error_estimate);
      });
  add_summary(pair);

  py::class_<PairContact> alone(module, "PairContact",
                                "The contact of two bodies as if there were no others, without damping and friction.");
  alone.def_readonly("a", &PairContact::a, "Name of the first body.")
      .def_readonly("b", &PairContact::b, "Name of the second body.")
      .def_property_readonly(
          "touching", [](const PairContact& p) { return !p.surface->summary.empty(); },
          "Whether the bodies overlap and may touch.")
      .def_property_readonly(
          "point", [](const PairContact& p) { return view(p.surface->point, keep(p.surface)); },
          "Positions [m], shape (points, 3).")
      .def_property_readonly(
          "normal", [](const PairContact& p) { return view(p.surface->normal, keep(p.surface)); },
          "Unit normals, out of a and into b, shape (points, 3).")
      .def_property_readonly(
          "point_area", [](const PairContact& p) { return view(p.surface->area, keep(p.surface)); },
          "Area that each point stands for [m^2], shape (points,).")
      .def_property_readonly(
          "pressure", [](const PairContact& p) { return view(p.surface->pressure, keep(p.surface)); },
          "Elastic pressure [Pa], shape (points,).")
      .def("__repr__", [](const PairContact& p) {
        return py::str("<supple.PairContact {} and {}, |force| = {:.4g} N, area = {:.4g} m^2, error estimate {:.1e}>")
            .format(p.a, p.b, p.summary().force.norm(), p.summary().area, p.summary().error_estimate);
      });
  add_summary(alone);
}

Contacts report(Handle& handle) {
  return {std::make_shared<const ContactReport>(
      handle.use([](scenes::Simulation& s) { return scenes::report_contacts(s); }))};
}

PairContact contact(Handle& handle, const std::string& a, const std::string& b, double error) {
  return handle.use([&](scenes::Simulation& s) {
    std::uint32_t first = scenes::find_body(s, a), second = scenes::find_body(s, b);
    auto surface = std::make_shared<const ContactSurface>(scenes::solve_contact(s, first, second, error));
    if (second < first) std::swap(first, second);
    return PairContact{scenes::body_name(s.model(), s.bodies(), first),
                       scenes::body_name(s.model(), s.bodies(), second), std::move(surface)};
  });
}

PairContact touch(const Field& a, const Field& b, double error) {
  if (!(error >= 1e-10 && error <= 0.1)) throw py::value_error("error: expected a relative error from 1e-10 to 0.1");
  if (a.body == b.body) throw py::value_error("b: expected another body than a");
  const py::gil_scoped_release others_run;
  return {"a", "b", std::make_shared<const ContactSurface>(collision::touch(*a.body, *b.body, error).surface)};
}

}  // namespace

void bind_contacts(py::module_& module, Simulation& simulation) {
  bind_pair(module);
  py::class_<Contacts>(
      module, "Contacts",
      "All contacts of one state. It is a copy, which later steps do not change. Iterates over its pairs.")
      .def_property_readonly(
          "pairs",
          [](const Contacts& c) {
            std::vector<Pair> pairs;
            for (std::size_t k = 0; k < c.report->pairs.size(); ++k) pairs.push_back({c.report, k});
            return pairs;
          },
          "The pairs in contact, as ContactPair, sorted by the numbers of their bodies, fixed bodies last.")
      .def_property_readonly(
          "pair", [](const Contacts& c) { return view(c.report->points.pair, keep(c.report)); },
          "Which of `pairs` each point belongs to, shape (points,), a view of the report.")
      .def_property_readonly(
          "point", [](const Contacts& c) { return view(c.report->points.point, keep(c.report)); },
          "Quadrature points of all pairs [m], shape (points, 3), a view of the report.")
      .def_property_readonly(
          "normal", [](const Contacts& c) { return view(c.report->points.normal, keep(c.report)); },
          "Unit normals, out of the first body of the pair, shape (points, 3), a view of the report.")
      .def_property_readonly(
          "point_area", [](const Contacts& c) { return view(c.report->points.area, keep(c.report)); },
          "Area that each point stands for [m^2], shape (points,), a view of the report.")
      .def_property_readonly(
          "pressure", [](const Contacts& c) { return view(c.report->points.pressure, keep(c.report)); },
          "Elastic pressure [Pa], shape (points,), a view of the report.")
      .def_property_readonly(
          "force", [](const Contacts& c) { return view(c.report->loads.force, keep(c.report)); },
          "Contact force on every particle, damping and friction included [N], shape (particles, 3), a view of the report.")
      .def_property_readonly(
          "torque", [](const Contacts& c) { return view(c.report->loads.torque, keep(c.report)); },
          "Contact torque on every particle about its centre [N m], shape (particles, 3), a view of the report.")
      .def_property_readonly(
          "energy", [](const Contacts& c) { return c.report->energy; }, "Energy of compression of all pairs [J].")
      .def_property_readonly(
          "dissipated_power", [](const Contacts& c) { return c.report->dissipated_power; }, "Power dissipated by all pairs [W].")
      .def_property_readonly(
          "dissipated_work", [](const Contacts& c) { return c.report->dissipated_work; },
          "Work dissipated by damping and friction of all pairs since the start [J].")
      .def("__len__", [](const Contacts& c) { return c.report->pairs.size(); })
      .def("__iter__", [](const py::object& self) { return py::iter(self.attr("pairs")); })
      .def("__getitem__", [](const Contacts& c, py::ssize_t k) {
        const py::ssize_t n = std::ssize(c.report->pairs);
        if (k < -n || k >= n) throw py::index_error("pair " + std::to_string(k) + " of " + std::to_string(n));
        return Pair{c.report, static_cast<std::size_t>(k < 0 ? k + n : k)};
      });

  using core::LawReport;
  py::class_<LawReport, std::shared_ptr<LawReport>>(module, "LawLoads", "Forces, torques and energy of one law.")
      .def_property_readonly(
          "name", [](const LawReport& l) { return l.name; },
          "\"OBJECT/LAW\", \"gravity\", \"external\" or \"contact\".")
      .def_property_readonly(
          "energy", [](const LawReport& l) { return l.energy; }, "Energy [J]; 0 for gravity and external loads.")
      .def_property_readonly(
          "force", [](const std::shared_ptr<LawReport>& l) { return view(l->loads.force, keep(l)); },
          "Force on every particle [N], shape (particles, 3).")
      .def_property_readonly(
          "torque", [](const std::shared_ptr<LawReport>& l) { return view(l->loads.torque, keep(l)); },
          "Torque on every particle about its centre [N m], shape (particles, 3).")
      .def("__repr__", [](const LawReport& l) {
        return py::str("<supple.LawLoads {}, energy = {:.6g} J>").format(l.name, l.energy);
      });

  module.def("contact", &touch, py::arg("a"), py::arg("b"), py::arg("error") = 1e-4,
             "The contact of two bodies that need no scene, each a Field, without damping and friction.\n\n"
             "error  required relative error of force, area and centre of pressure, from 1e-10 to 0.1; error_estimate of the answer is the estimate of the\n"
             "       error that was reached.");

  simulation.def("contacts", &report, "All contacts of the current state.")
      .def("contact", &contact, py::arg("a"), py::arg("b"), py::arg("error") = 1e-4,
           "The contact of two bodies in the current state as if there were no others, by their names (\"ground\" and "
           "obstacles have names, too).\n\n"
           "error  required relative error, from 1e-10 to 0.1; error_estimate of the answer is the estimate of the error that was "
           "reached.")
      .def(
          "energy_estimates",
          [](Handle& h) { return own(h.use([](scenes::Simulation& s) { return s.energy_estimates(); })); },
          "What the energies of contacts() may be off by [J], shape (pairs,). It solves the contacts once more, to a hundredth of their error.")
      .def(
          "contact_capacity",
          [](Handle& h, const std::string& a, const std::string& b) {
            return h.use([&](scenes::Simulation& s) {
              return scenes::contact_capacity(s, scenes::find_body(s, a), scenes::find_body(s, b));
            });
          },
          py::arg("a"), py::arg("b"),
          "The largest contact energy [J] that two touching bodies can reach when they are pushed together along their "
          "contact force; bodies that approach with\n"
          "more kinetic energy pass through each other.")
      .def(
          "forces",
          [](Handle& h) {
            std::vector<std::shared_ptr<LawReport>> laws;
            for (LawReport& law : h.use([](scenes::Simulation& s) { return scenes::report_forces(s); })) {
              laws.push_back(std::make_shared<LawReport>(std::move(law)));
            }
            return laws;
          },
          "Forces, torques and energies of each law, as a list of LawLoads; the last one is \"contact\".");
}

}  // namespace supple::python
