/// @file fields_laws.h
/// The keys of laws and loads on particles; see fields.h.
#pragma once

#include <algorithm>
#include <initializer_list>
#include <string>

#include "file/fields/fields_rules.h"
#include "file/read_scene_faults.h"
#include "supple/core/gay_berne.h"
#include "supple/core/lennard_jones.h"
#include "supple/core/math.h"

namespace supple::scenes {

/// Whether an object has a law without energy.
inline bool literal_laws(const ObjectDesc& d) {
  return std::any_of(d.interactions.begin(), d.interactions.end(), [](const InteractionDesc& i) { return i.paper_literal; });
}

/// Checks the combination of keys of the cohesion law.
template <class Archive>
void check_cohesion(Archive& archive, const InteractionDesc& d) {
  const bool by_maximum = d.maximum_distance || d.maximum_ratio || d.maximum_force || d.scale_force;
  const bool by_gain = d.gain || d.alpha;
  archive.check(by_maximum || by_gain, "", "expected maximum_distance and maximum_force, or gain and alpha", "none of them", "");
  archive.check(!(by_maximum && by_gain), d.gain ? "gain" : "alpha",
                "expected either maximum_distance and maximum_force, or gain and alpha", "keys of both", "");
  archive.check(by_gain || !by_maximum || ((d.maximum_distance || d.maximum_ratio) && (d.maximum_force || d.scale_force)),
                d.maximum_force   ? "maximum_force"
                : d.scale_force   ? "scale_force"
                : d.maximum_ratio ? "maximum_ratio"
                                  : "maximum_distance",
                "expected maximum_distance or maximum_ratio, and maximum_force or scale_force", "one of them", "");
  archive.check(!(d.maximum_distance && d.maximum_ratio), "maximum_ratio", "expected either maximum_distance or maximum_ratio",
                "both", "");
  archive.check(!(d.maximum_force && d.scale_force), "scale_force", "expected either maximum_force or scale_force", "both", "");
  archive.check(by_maximum || !by_gain || (d.gain && d.alpha), d.gain ? "gain" : "alpha", "expected gain and alpha together",
                "one of them", "");
  if (d.rest_distance && d.maximum_distance) {
    archive.check(*d.maximum_distance > *d.rest_distance, "maximum_distance",
                  "expected more than rest_distance = " + number_text(*d.rest_distance) + " [m]",
                  number_text(*d.maximum_distance), "");
  }
}

/// Checks the combination of keys of the Lennard-Jones law.
template <class Archive>
void check_lennard_jones(Archive& archive, const InteractionDesc& d) {
  archive.check(d.depth || d.scale_force, "", "expected depth or scale_force", "neither", "");
  archive.check(!(d.depth && d.scale_force), "depth", "expected either depth or scale_force", "both", "");
  archive.check(d.repulsive > d.attractive, "repulsive", "expected more than attractive = " + std::to_string(d.attractive),
                std::to_string(d.repulsive), "");
  archive.check(!d.switch_from || d.cut_off, "switch_from", "expected a cut_off to switch to", "none", "");
  if (d.switch_from && d.cut_off) {
    archive.check(*d.switch_from < *d.cut_off, "switch_from", "expected less than cut_off = " + number_text(*d.cut_off) + " [m]",
                  number_text(*d.switch_from), "");
  }
  archive.check(!d.geometric || d.cut_off, "cut_off", "expected a cut-off for a geometric law", "none", "");
}

/// Checks the combination of keys of the Gay-Berne law.
template <class Archive>
void check_gay_berne(Archive& archive, const InteractionDesc& d) {
  archive.check(d.depth.has_value(), "depth", "expected an energy > 0 [J]", "nothing", "this key is required");
  archive.check(d.geometric, "geometric", "expected true for gay_berne", "false",
                "it acts between all ellipsoids in range; for bonds there is directed_cohesion");
  archive.check(d.cut_off.has_value(), "cut_off", "expected a cut-off for a geometric law", "none", "");
  if (!d.cut_off) return;
  const double length = 2.0 * d.semi_axes.maxCoeff();
  archive.check(*d.cut_off > length, "cut_off", "expected more than the longest ellipsoid, " + number_text(length) + " [m]",
                number_text(*d.cut_off), "");
  archive.check(!d.switch_from || *d.switch_from < *d.cut_off, "switch_from",
                "expected less than cut_off = " + number_text(*d.cut_off) + " [m]", number_text(d.switch_from.value_or(0.0)), "");
}

template <class Archive>
void fields(Archive& archive, InteractionDesc& d) {
  using enum LawKind;
  const auto only = [&d](const Rule& rule, std::initializer_list<LawKind> laws) { return rule.only("law", d.law, laws); };
  archive.required("law", d.law, {}, "law that acts between bonded particles");
  archive("neighbours", d.neighbours, between(1.0, 1000.0, kNumber), "bonds join particles whose numbers differ by at most this");
  archive("within", d.within, above(0.0, kLength),
          "instead of neighbours: bonds join particles nearer than this at rest; with geometric: range of the law");
  archive("geometric", d.geometric, only({}, {Cohesion, LinearCohesion, LennardJones, GayBerne, Coplanarity, CoNormality, CoCircularity}),
          "acts between all particles of the object in range, found in each step, instead of along bonds; required for gay_berne");
  archive("normalised", d.normalised, only({}, {Coplanarity, CoCircularity}),
          "weight psi / d^2 instead of psi, independent of scale; strength is then in J");
  archive("paper_literal", d.paper_literal, only({}, {FormRadius}),
          "the law as printed by Lombardo & Puech 1995, for comparison; it conserves neither energy nor momentum");
  archive.required("stretch", d.stretch, only(at_least(0.0, kStiffness), {BondFrame}), "k_s, stiffness against displacement");
  archive.required("rotation", d.rotation, only(at_least(0.0, kTorque), {BondFrame}), "k_theta, stiffness against rotation");
  archive.required("strength", d.strength, only(at_least(0.0, kBending), {Form, DirectedForm}),
                   "k; beside a law against shear, such as bond_frame, a chain bends like a beam of EI = 2 k / spacing");
  archive.required("strength", d.strength,
                   only(at_least(0.0, d.normalised ? kEnergy : kStiffness), {FormRadius, Coplanarity, CoCircularity}), "k");
  archive.required("strength", d.strength, only(at_least(0.0, kEnergy), {CoNormality}), "k");
  archive("linear", d.linear, only(at_least(0.0, kDamping), {Friction}), "c, against relative velocity");
  archive("angular", d.angular, only(at_least(0.0, kAngularDamping), {Friction}), "c_r, against relative spin");
  archive("rest_distance", d.rest_distance, only(above(0.0, kLength).or_auto(), {Cohesion, LinearCohesion, LennardJones}),
          "r0; auto: length of each bond at rest");
  archive("maximum_distance", d.maximum_distance, only(above(0.0, kLength), {Cohesion}), "r_m, distance of the largest attraction");
  archive("maximum_ratio", d.maximum_ratio, only(above(1.0, kNumber), {Cohesion}),
          "r_m / r0, instead of maximum_distance; gives the same curve for every rest distance");
  archive("maximum_force", d.maximum_force, only(above(0.0, kForce), {Cohesion}), "F_max, the largest attraction");
  archive("scale_force", d.scale_force, only(above(0.0, kForce), {Cohesion, LinearCohesion, DirectedCohesion, LennardJones}),
          "F0 of the cohesion laws (for cohesion instead of maximum_force); E of lennard_jones (instead of depth)");
  archive("gain", d.gain, only(above(0.0, kPressure), {Cohesion}), "E, instead of maximum_distance and maximum_force");
  archive("alpha", d.alpha, only(above(0.0, kInverseArea), {Cohesion}), "alpha, with gain");
  archive("table_error", d.table_error, only(between(1e-9, 0.1, kNumber), {Cohesion}),
          "the force comes from a table with at most this error over F_max; absent: no table");
  archive("shape", d.shape, only(above(0.0, kNumber), {LinearCohesion, DirectedCohesion}), "a, how fast the force falls off");
  archive("eta", d.eta, only(at_least(0.0, kNumber), {LinearCohesion}), "stiffness at rest over F0 / r0");
  archive.required("semi_axes", d.semi_axes, only(above(0.0, kLength), {DirectedCohesion, GayBerne}),
                   "of each particle's ellipsoid, along the particle's x, y, z; bonded particles are at rest where their ellipsoids touch");
  archive("depth", d.depth, only(above(0.0, kEnergy), {LennardJones, GayBerne}), "binding energy; epsilon of gay_berne");
  archive("sigma", d.sigma, only(above(0.0, kLength), {GayBerne}),
          "distance over which the force between surfaces falls off; absent: twice the smallest semi-axis");
  archive("gamma", d.gamma, only(above(0.0, kNumber), {GayBerne}), "shift of the distance between surfaces, over sigma");
  archive("wells", d.wells, only(above(0.0, kNumber), {GayBerne}), "depth for approach along the particle's x, y, z, over depth");
  archive("upsilon", d.upsilon, only(between(0.0, core::SwitchedGayBerne::kLargestExponent, kNumber), {GayBerne}),
          "exponent of the shapes' strength");
  archive("mu", d.mu, only(between(1.0, core::SwitchedGayBerne::kLargestExponent, kNumber), {GayBerne}),
          "exponent of the wells' strength");
  archive("repulsive", d.repulsive, only(between(2.0, core::LennardJones::kLargestExponent, kNumber), {LennardJones}),
          "n of (r0/d)^n");
  archive("attractive", d.attractive, only(between(1.0, core::LennardJones::kLargestExponent - 1, kNumber), {LennardJones}),
          "m of (r0/d)^m");
  archive("cut_off", d.cut_off, only(above(0.0, kLength), {LennardJones, GayBerne}),
          "distance at which force and energy become 0; absent: none");
  archive("switch_from", d.switch_from, only(above(0.0, kLength), {LennardJones, GayBerne}),
          "distance from which the potential is switched off; absent: the force is shifted, or 0.9 cut_off for gay_berne");
  archive("range", d.range,
          only(above(0.0, kLength), {Form, FormRadius, DirectedForm, Coplanarity, CoNormality, CoCircularity}),
          "h of the weight (1 - d^2/h^2)^3; absent: weight 1");
  archive.check(!(archive.given("neighbours") && d.within), "within", "expected either neighbours or within", "both", "");
  archive.check(!(archive.given("neighbours") && d.geometric), "neighbours", "expected either neighbours or geometric", "both", "");
  const bool by_range = d.law == Coplanarity || d.law == CoNormality || d.law == CoCircularity;
  archive.check(!d.geometric || d.rest_distance || by_range || d.law == GayBerne, "rest_distance",
                "expected a length > 0 [m] for a geometric law", "nothing", "");
  archive.check(!d.geometric || d.range || !by_range, "range", "expected a length > 0 [m] for a geometric law", "nothing", "");
  archive.check(!(d.geometric && d.normalised), "normalised", "expected either normalised or geometric", "both",
                "psi / d^2 grows without bound where two particles meet");
  if (d.law == Cohesion) check_cohesion(archive, d);
  if (d.law == LennardJones) check_lennard_jones(archive, d);
  if (d.law == GayBerne) check_gay_berne(archive, d);
  if (d.law == LinearCohesion || d.law == DirectedCohesion) {
    archive.check(d.scale_force.has_value(), "scale_force", "expected a force > 0 [N]", "nothing", "this key is required");
  }
  archive.check(!(d.geometric && (d.law == LennardJones || d.law == GayBerne) && d.within), "within",
                "expected cut_off alone for the range", "both", "");
  archive.check(!(d.geometric && by_range && d.within), "within", "expected range alone for a geometric law", "both", "");
}

template <class Archive>
void fields(Archive& archive, RepulsionDesc& d) {
  archive.required("force", d.force, above(0.0, kForce), "force at the distance d0");
  archive.required("distance", d.distance, above(0.0, kLength), "d0");
  archive.required("length", d.length, above(0.0, kLength), "distance over which the force falls to 1/e");
  archive("own", d.own, {}, "also between all particles of the object; false: only between those of different types");
}

template <class Archive>
void fields(Archive& archive, MediumDesc& d) {
  archive("linear", d.linear, at_least(0.0, kRate), "gamma: force -gamma m v");
  archive("angular", d.angular, at_least(0.0, kRate), "gamma_r: torque -gamma_r I omega");
}

template <class Archive>
void fields(Archive& archive, BreakingDesc& d) {
  archive("stretch", d.stretch, above(0.0, kNumber), "largest d / d0 - 1 of a pair");
  archive("energy", d.energy, above(0.0, kEnergy), "largest energy of all laws of a pair");
  archive("force", d.force, above(0.0, kForce), "largest tension F_c; with couple the pair breaks where F / F_c + (M / M_c)^2 > 1");
  archive("couple", d.couple, above(0.0, kTorque), "largest bending moment M_c on either particle");
  archive.check(d.stretch || d.energy || d.force || d.couple, "", "expected stretch, energy, force or couple", "none of them", "");
}

template <class Archive>
void fields(Archive& archive, YieldingDesc& d) {
  archive.required("energy", d.energy, at_least(0.0, kEnergy), "energy of a bond frame at which it yields");
  archive("time", d.time, at_least(0.0, kTime), "time in which the difference to the rest pose falls to 1/e; 0: at once");
}

template <class Archive>
void fields(Archive& archive, RayleighDesc& d) {
  archive("mass", d.mass, at_least(0.0, kRate), "alpha: force -alpha M q', as of a medium");
  archive("stiffness", d.stiffness, at_least(0.0, kTime), "beta: force -beta K q'; the damping ratio of a mode is beta omega / 2");
}

}  // namespace supple::scenes
