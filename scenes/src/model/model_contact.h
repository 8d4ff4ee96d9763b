/// @file model_contact.h
/// The part of a model that concerns contact: rules, materials of pairs, samples, repulsion, and the contact frequency.
#pragma once

#include "model/model_faults.h"
#include "output/run/memory_budget.h"
#include "supple/scenes/model.h"

namespace supple::scenes {

/// Smallest distance of the surface of a single primitive from its skeleton [m].
[[nodiscard]] double iso_radius(const implicit::Primitive& primitive, double iso);
/// Addition to that of a solid skeleton: the smallest half size of a box, else 0 [m].
[[nodiscard]] double solid_half_size(const implicit::Primitive& primitive);
/// Hunt & Crossley's d for which a body that arrives at `speed` leaves at e times that speed, whatever the elastic law:
/// d v - ln(1 + d v) + d e v + ln(1 - d e v) = 0 (docs/notation.md, restitution). @pre 0 < e <= 1, speed > 0
[[nodiscard]] double dissipation_for(double restitution, double speed);

/// Number of bodies of an object that may touch each other, from the initial state; objects that may break count as two.
[[nodiscard]] std::size_t own_contacts(const ObjectModel& object);

/// Largest coefficient of friction between any two bodies that may touch; 0: none has any.
[[nodiscard]] double largest_friction(const Model& model);

/// Upper estimate of the angular frequency of all contacts that are possible, the compliances of both bodies in series [rad/s]; at most
/// `Model::contact_frequency`, which takes every body as if it met a rigid one.
[[nodiscard]] double pair_contact_frequency(const Model& model);

/// @param budget  counts surface samples before they are made
void build_contact(const Scene& scene, MemoryBudget& budget, Model& model, ModelFaults& faults);

}  // namespace supple::scenes
