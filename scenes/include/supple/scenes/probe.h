/// @file supple/scenes/probe.h
/// Single values of the current state of a simulation. Reading them changes no later state. `query.h` puts
/// them into JSON, contact_report.h has all contacts at once.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Index of a contact body: first Simulation::bodies, then the fixed ones ("ground", obstacles).
/// @throws Error{Usage} for an unknown name, with the nearest one
[[nodiscard]] std::uint32_t find_body(const Simulation& simulation, std::string_view name);

/// The undeformed field of a body: F > 0 inside, and its gradient [1/m]; the outward normal is -grad F / |grad F|.
/// @param points  [m], shape [n]   @param values, gradients  shape [n]
/// @throws Error{Usage} for a body without a surface
void evaluate_field(Simulation& simulation, std::uint32_t body, std::span<const Vec3> points, std::span<double> values,
                    std::span<Vec3> gradients);

/// Energy, forces and torques of each law, contact last: its damping and friction are in the loads, not in the energy.
[[nodiscard]] std::vector<core::LawReport> report_forces(Simulation& simulation);

/// The contact of two bodies in the current state as if there were no others, to the given error. Its summary is empty where they do not
/// touch. @param error  relative, of force, area and centre of pressure, in [1e-10, 0.1]; Summary::error_estimate is the achieved one
/// @throws Error{Usage} for an error outside this range, or the same body twice
[[nodiscard]] collision::ContactSurface solve_contact(Simulation& simulation, std::uint32_t a, std::uint32_t b, double error);

/// The largest contact energy [J] that two touching bodies can reach when they are pushed together along their force; bodies with more
/// kinetic energy pass through each other (collision/approach.h). @throws Error{Usage} for bodies that do not touch
[[nodiscard]] double contact_capacity(Simulation& simulation, std::uint32_t a, std::uint32_t b);

}  // namespace supple::scenes
