#include "model/model_laws.h"

#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <utility>

#include "file/fields/fields_rules.h"
#include "supple/core/arrange.h"

namespace supple::scenes {
namespace {

constexpr double kGeometricTail = 1e-3;  // |f| at the range of a geometric cohesion over the largest attraction

core::LinearCohesion linear_cohesion(const InteractionDesc& d, double rest_distance) {
  return {.r0 = d.rest_distance.value_or(rest_distance), .f0 = d.scale_force.value_or(0.0), .a = d.shape, .eta = d.eta};
}

double distance_of_maximum(const InteractionDesc& d, double r0) {
  return d.maximum_ratio ? *d.maximum_ratio * r0 : d.maximum_distance.value_or(0.0);
}

/// Nothing where the largest attraction is not beyond the rest distance r0, or no force is given.
std::optional<core::Cohesion> cohesion_of(const InteractionDesc& d, double r0) {
  if (d.gain && d.alpha) return core::Cohesion::from_gain(r0, *d.gain, *d.alpha);
  const double r_m = distance_of_maximum(d, r0);
  if (!(r_m > r0) || !(d.maximum_force || d.scale_force)) return std::nullopt;
  if (d.scale_force) return core::Cohesion::from_ratio(r0, r_m / r0, *d.scale_force);
  return core::Cohesion::from_maximum(r0, r_m, *d.maximum_force);
}

/// Those bonds whose particles interact completely.
core::Bonds complete_bonds(const core::Bonds& bonds, const core::ParticleSet& set, bool hinges_join) {
  core::Bonds complete;
  for (std::size_t b = 0; b < bonds.first.size(); ++b) {
    if (!core::interact_completely(set.kind[bonds.first[b]], set.kind[bonds.second[b]], hinges_join)) continue;
    complete.first.push_back(bonds.first[b]);
    complete.second.push_back(bonds.second[b]);
  }
  return complete;
}

/// Adds the laws of one object.
class LawBuilder {
 public:
  LawBuilder(Model& model, ModelFaults& faults, const ObjectModel& object, std::string key)
      : model_(model), faults_(faults), object_(object), key_(std::move(key)) {}

  void add(const InteractionDesc& d, std::size_t index) {
    const std::string key = key_ + ".interactions[" + std::to_string(index) + ']';
    if (d.geometric) {
      add_geometric(d, key);
      return;
    }
    const core::Bonds near = d.within ? core::bonds_within(model_.rest.position, object_.first, object_.last, *d.within)
                                      : core::bonds_along(object_.first, object_.last, d.neighbours);
    const core::Bonds bonds = complete_bonds(near, model_.particles, object_.hinges_join);
    if (bonds.first.empty()) {
      faults_.add(key, "expected a bond", "none",
                  !near.first.empty() ? "'kinds' allows none between neighbours"
                  : d.within ? "no two particles are nearer than " + number_text(*d.within) + " m"
                           : "the object has a single particle");
      return;
    }
    if (d.law == LawKind::Friction) {
      model_.interactions.friction.push_back({name(d), bonds.first, bonds.second, d.linear, d.angular});
      return;
    }
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      if (model_.rest.position[bonds.first[b]] == model_.rest.position[bonds.second[b]]) {
        faults_.add(key, "expected bonded particles at different places",
                    "particles " + std::to_string(bonds.first[b] - object_.first) + " and " +
                        std::to_string(bonds.second[b] - object_.first) + " at the same place",
                    "");
        return;
      }
    }
    add_bonded(d, bonds, key);
  }

 private:
  void add_bonded(const InteractionDesc& d, const core::Bonds& bonds, const std::string& key) {
    const core::Weight weight{.range = d.range.value_or(0.0)};
    core::Interactions& laws = model_.interactions;
    const auto fill_same = [&](auto& list, const auto& law) {
      fill(list, d, bonds, [&](const core::PairPose&) { return law; });
    };
    switch (d.law) {
      case LawKind::Cohesion:
        if (d.table_error) {
          fill(laws.tabulated_cohesion, d, bonds,
               [&](const core::PairPose& rest) { return tabulated(d, cohesion(d, rest.r.norm(), key)); });
        } else {
          fill(laws.cohesion, d, bonds, [&](const core::PairPose& rest) { return cohesion(d, rest.r.norm(), key); });
        }
        break;
      case LawKind::LinearCohesion:
        fill(laws.linear_cohesion, d, bonds, [&](const core::PairPose& rest) { return linear_cohesion(d, rest.r.norm()); });
        break;
      case LawKind::DirectedCohesion:
        fill(laws.directed_cohesion, d, bonds, [&](const core::PairPose& rest) {
          core::DirectedCohesion law{
              .scale = 0.0, .a = d.shape, .semi_axes_a = d.semi_axes, .semi_axes_b = d.semi_axes};
          law.scale = d.scale_force.value_or(0.0) * law.rest_distance(rest);
          return law;
        });
        break;
      case LawKind::LennardJones:
        fill(laws.lennard_jones, d, bonds, [&](const core::PairPose& rest) { return lennard_jones(d, rest.r.norm()); });
        break;
      case LawKind::GayBerne: break;  // geometric only
      case LawKind::Form:
        fill(laws.form, d, bonds, [&](const core::PairPose& rest) {
          return core::Form{d.strength, core::Form::fit_curvature(rest.r, rest.normal_a, rest.normal_b), weight};
        });
        break;
      case LawKind::FormRadius:
        if (d.paper_literal) {
          add_literal_form(d, bonds, weight, key);
        } else {
          fill(laws.form_radius, d, bonds,
               [&](const core::PairPose& rest) { return core::FormRadius{d.strength, radius(rest, key), weight}; });
        }
        break;
      case LawKind::DirectedForm: add_directed_form(d, bonds, weight); break;
      case LawKind::BondFrame:
        fill(laws.bond_frame, d, bonds,
             [&](const core::PairPose& rest) { return core::BondFrame::from_rest(d.stretch, d.rotation, rest); });
        break;
      case LawKind::Coplanarity:
        if (d.normalised) {
          fill_same(laws.normalised_coplanarity, core::NormalisedCoplanarity{d.strength, weight});
        } else {
          fill_same(laws.coplanarity, core::Coplanarity{d.strength, weight});
        }
        break;
      case LawKind::CoNormality: fill_same(laws.co_normality, core::CoNormality{d.strength, weight}); break;
      case LawKind::CoCircularity:
        if (d.normalised) {
          fill_same(laws.normalised_co_circularity, core::NormalisedCoCircularity{d.strength, weight});
        } else {
          fill_same(laws.co_circularity, core::CoCircularity{d.strength, weight});
        }
        break;
      case LawKind::Friction: break;
    }
  }

  /// Between all particles of the object within the range of the law, as their kinds allow.
  void add_geometric(const InteractionDesc& d, const std::string& key) {
    const std::uint32_t object = model_.particles.object[object_.first];
    const auto begin = model_.particles.kind.begin();
    const bool kinds = std::any_of(begin + object_.first, begin + object_.last, [](std::uint32_t k) { return k != 0; });
    const core::PairKinds taken = !kinds                ? core::PairKinds::Any
                                  : object_.hinges_join ? core::PairKinds::CompleteWithHinges
                                                        : core::PairKinds::Complete;
    const auto add_list = [&](auto& lists, double range, const auto& law) {
      lists.push_back(
          {.name = name(d), .object_a = object, .object_b = object, .range = range, .law = law, .kinds = taken});
    };
    core::Interactions& laws = model_.interactions;
    const double r0 = d.rest_distance.value_or(0.0);
    const core::Weight weight{.range = d.range.value_or(0.0)};
    if (d.law == LawKind::GayBerne) {
      const core::SwitchedGayBerne law = gay_berne(d);
      add_list(laws.gay_berne, law.cut_off, law);
    } else if (d.law == LawKind::Coplanarity) {
      add_list(laws.geometric_coplanarity, weight.range, core::Coplanarity{d.strength, weight});
    } else if (d.law == LawKind::CoNormality) {
      add_list(laws.geometric_co_normality, weight.range, core::CoNormality{d.strength, weight});
    } else if (d.law == LawKind::CoCircularity) {
      add_list(laws.geometric_co_circularity, weight.range, core::CoCircularity{d.strength, weight});
    } else if (d.law == LawKind::LennardJones) {
      add_list(laws.geometric_lennard_jones, d.cut_off.value_or(0.0), lennard_jones(d, r0));
    } else if (d.law == LawKind::LinearCohesion) {
      const core::LinearCohesion law = linear_cohesion(d, r0);
      add_list(laws.geometric_linear_cohesion, geometric_range(d).value_or(0.0), law);
    } else {
      const core::Cohesion law = cohesion(d, r0, key);
      const double range = d.within.value_or(law.influence_radius(kGeometricTail));
      if (d.table_error) {
        add_list(laws.geometric_tabulated_cohesion, range, tabulated(d, law));
      } else {
        add_list(laws.geometric_cohesion, range, law);
      }
    }
  }

  core::LennardJones lennard_jones(const InteractionDesc& d, double rest_distance) {
    const double r0 = d.rest_distance.value_or(rest_distance);
    const double n = d.repulsive, m = d.attractive;
    return {.r0 = r0,
            .depth = d.depth.value_or(d.scale_force.value_or(0.0) * r0 * (n - m) / (n * m)),
            .repulsive = d.repulsive,
            .attractive = d.attractive,
            .cut_off = d.cut_off.value_or(0.0),
            .switch_from = d.switch_from.value_or(0.0)};
  }

  static core::SwitchedGayBerne gay_berne(const InteractionDesc& d) {
    const double cut_off = d.cut_off.value_or(0.0);
    return {.ellipsoid = {.epsilon = d.depth.value_or(0.0),
                          .sigma = d.sigma.value_or(2.0 * d.semi_axes.minCoeff()),
                          .gamma = d.gamma,
                          .radii = d.semi_axes,
                          .well = d.wells,
                          .upsilon = d.upsilon,
                          .mu = d.mu},
            .switch_from = d.switch_from.value_or(kGayBerneSwitch * cut_off),
            .cut_off = cut_off};
  }

  /// The table of the law's shape: one for all bonds of that shape.
  core::TabulatedCohesion tabulated(const InteractionDesc& d, const core::Cohesion& law) {
    std::shared_ptr<const core::CohesionTable>& table = tables_[{law.a, *d.table_error}];
    if (!table) {
      table = std::make_shared<const core::CohesionTable>(core::CohesionTable::with_error(law.a, *d.table_error));
    }
    return {.r0 = law.r0, .f0 = law.f0, .table = table};
  }

  /// Each particle's own radius, by least squares over its bonds: R = sum r . dn / sum |dn|^2.
  void add_literal_form(const InteractionDesc& d, const core::Bonds& bonds, const core::Weight& weight,
                        const std::string& key) {
    std::vector<double> along(object_.last - object_.first), squares(object_.last - object_.first);
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      const core::PairPose rest = rest_pose(bonds.first[b], bonds.second[b]);
      const Vec3 change = rest.normal_b - rest.normal_a;
      for (const std::uint32_t i : {bonds.first[b], bonds.second[b]}) {
        along[i - object_.first] += rest.r.dot(change);
        squares[i - object_.first] += change.squaredNorm();
      }
    }
    const auto radius_of = [&](std::uint32_t i) {
      if (squares[i - object_.first] > 1e-18) return along[i - object_.first] / squares[i - object_.first];
      fail_flat(key);
      return 0.0;
    };
    core::BondedLaw<core::LiteralForm> list{name(d), bonds.first, bonds.second, {}};
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      list.law.push_back({d.strength, radius_of(bonds.first[b]), radius_of(bonds.second[b]), weight});
    }
    model_.interactions.literal_form.push_back(std::move(list));
  }

  /// Each particle's shape operator, by least squares over its bonds.
  void add_directed_form(const InteractionDesc& d, const core::Bonds& bonds, const core::Weight& weight) {
    const std::size_t n = object_.last - object_.first;
    std::vector<std::vector<Vec3>> offsets(n), changes(n);
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      const core::PairPose rest = rest_pose(bonds.first[b], bonds.second[b]);
      const Vec3 change = rest.normal_b - rest.normal_a;
      offsets[bonds.first[b] - object_.first].push_back(rest.r);
      changes[bonds.first[b] - object_.first].push_back(change);
      offsets[bonds.second[b] - object_.first].push_back(-rest.r);
      changes[bonds.second[b] - object_.first].push_back(-change);
    }
    std::vector<Mat3> shape;
    for (std::size_t k = 0; k < n; ++k) {
      const std::uint32_t i = object_.first + static_cast<std::uint32_t>(k);
      const Mat3 q = model_.rest.orientation[i].toRotationMatrix();
      shape.push_back(q.transpose() *
                      core::fit_shape_operator(q * model_.particles.normal[i], offsets[k], changes[k]) * q);
    }
    core::BondedLaw<core::DirectedForm> list{name(d), bonds.first, bonds.second, {}};
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      list.law.push_back(
          {d.strength, shape[bonds.first[b] - object_.first], shape[bonds.second[b] - object_.first], weight});
    }
    model_.interactions.directed_form.push_back(std::move(list));
  }

  /// "spiral/bond_frame"; a second law of the same kind is "spiral/bond_frame.2".
  std::string name(const InteractionDesc& d) {
    const int count = ++counts_[static_cast<std::size_t>(d.law)];
    return object_.name + '/' + std::string(name_of(d.law)) + (count > 1 ? '.' + std::to_string(count) : "");
  }

  [[nodiscard]] core::PairPose rest_pose(std::uint32_t a, std::uint32_t b) const {
    return core::pair_pose(model_.particles, model_.rest, a, b);
  }

  template <class Law, class Make>
  void fill(std::vector<core::BondedLaw<Law>>& list, const InteractionDesc& d, const core::Bonds& bonds, const Make& make) {
    core::BondedLaw<Law> law{name(d), bonds.first, bonds.second, {}};
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      law.law.push_back(make(rest_pose(bonds.first[b], bonds.second[b])));
    }
    list.push_back(std::move(law));
  }

  core::Cohesion cohesion(const InteractionDesc& d, double rest_distance, const std::string& key) {
    const double r0 = d.rest_distance.value_or(rest_distance);
    if (const std::optional<core::Cohesion> law = cohesion_of(d, r0)) return *law;
    faults_.add_once(key + ".maximum_distance", "expected more than the rest distance of every bond, " + number_text(r0) + " m here",
                     number_text(distance_of_maximum(d, r0)), "");
    return {.r0 = r0, .f0 = 1.0};
  }

  /// Least squares over the pair: R = r . (n_B - n_A) / |n_B - n_A|^2 (the inverse problem of Form::fit_curvature).
  double radius(const core::PairPose& rest, const std::string& key) {
    const Vec3 change = rest.normal_b - rest.normal_a;
    if (change.norm() < 1e-9) {
      fail_flat(key);
      return 0.0;
    }
    return rest.r.dot(change) / change.squaredNorm();
  }

  void fail_flat(const std::string& key) {
    faults_.add_once(key, "expected normals that differ along every bond for form_radius", "parallel ones",
                     "use 'law: form', which supports flat shapes");
  }

  static constexpr double kGayBerneSwitch = 0.9;  // of the cut-off

  Model& model_;
  ModelFaults& faults_;
  const ObjectModel& object_;
  std::string key_;
  std::array<int, EnumNames<LawKind>::names.size()> counts_{};
  std::map<std::pair<double, double>, std::shared_ptr<const core::CohesionTable>> tables_;  ///< by a and error
};

}  // namespace

void add_laws(const std::vector<InteractionDesc>& interactions, const ObjectModel& object, const std::string& key, Model& model,
              ModelFaults& faults) {
  LawBuilder laws(model, faults, object, key);
  for (std::size_t k = 0; k < interactions.size(); ++k) laws.add(interactions[k], k);
}

std::optional<double> geometric_range(const InteractionDesc& d) {
  const double r0 = d.rest_distance.value_or(0.0);
  switch (d.law) {
    case LawKind::GayBerne:
    case LawKind::LennardJones: return d.cut_off.value_or(0.0);
    case LawKind::Coplanarity:
    case LawKind::CoNormality:
    case LawKind::CoCircularity: return d.range.value_or(0.0);
    case LawKind::LinearCohesion: return d.within.value_or(linear_cohesion(d, r0).influence_radius(kGeometricTail));
    default: break;
  }
  if (d.within) return d.within;
  const std::optional<core::Cohesion> law = cohesion_of(d, r0);
  return law ? std::optional(law->influence_radius(kGeometricTail)) : std::nullopt;
}

}  // namespace supple::scenes
