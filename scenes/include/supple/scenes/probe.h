/// @file supple/scenes/probe.h
/// Single questions about the current state of a simulation, answered as numbers. Asking changes no later state. `query.h` puts
/// such answers into JSON, contact_report.h has all contacts at once.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Number of a contact body: of Simulation::bodies, and after them the fixed ones ("ground", obstacles).
/// @throws Error{Usage} for a name that none has, with the nearest one
[[nodiscard]] std::uint32_t find_body(const Simulation& simulation, std::string_view name);

/// The undeformed field of a body: F > 0 inside, and its gradient [1/m]; the outward normal is -grad F / |grad F|.
/// @param points  [m], shape [n]   @param values, gradients  shape [n]
/// @throws Error{Usage} for a body without a surface
void evaluate_field(Simulation& simulation, std::uint32_t body, std::span<const Vec3> points, std::span<double> values,
                    std::span<Vec3> gradients);

/// Energy, forces and torques law by law, contact the last: its damping and friction are in the loads, not in the energy.
[[nodiscard]] std::vector<core::LawReport> report_forces(Simulation& simulation);

/// The contact of two bodies as they are, as if there were no others, to an error of its own. Its summary is empty where they do not
/// touch. @param error  relative, of force, area and centre of pressure, in [1e-10, 0.1]; Summary::error_estimate says what is reached
/// @throws Error{Usage} for another error, or one body twice
[[nodiscard]] collision::ContactSurface solve_contact(Simulation& simulation, std::uint32_t a, std::uint32_t b, double error);

/// The largest contact energy [J] that two touching bodies can reach when they are pushed on along their force; what approaches with more
/// kinetic energy passes (collision/approach.h). @throws Error{Usage} for bodies that do not touch
[[nodiscard]] double contact_capacity(Simulation& simulation, std::uint32_t a, std::uint32_t b);

}  // namespace supple::scenes
