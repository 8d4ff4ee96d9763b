#include <algorithm>
#include <iterator>
#include <map>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "supple/scenes/model.h"

namespace supple::scenes {
namespace {

constexpr std::uint32_t kElsewhere = 0xffffffff;

/// The blend among the particles of a piece. @param particle  of the piece, counted from the first of the object
implicit::Blend take_blend(const implicit::Blend& all, std::span<const std::uint32_t> particle) {
  implicit::Blend blend = all;
  if (all.rule == implicit::BlendRule::Sum) return blend;
  blend.node.clear();
  for (const std::uint32_t p : particle) blend.node.push_back(all.node[p]);
  std::vector<std::uint32_t> present = blend.node;  // nodes that the piece has particles of, rising
  std::sort(present.begin(), present.end());
  present.erase(std::unique(present.begin(), present.end()), present.end());
  if (present.size() == 1) return {};  // it sums, and sums are cheaper without the rule
  const auto renumbered = [&](std::uint32_t node) {
    const auto place = std::lower_bound(present.begin(), present.end(), node);
    return place != present.end() && *place == node ? static_cast<std::uint32_t>(place - present.begin()) : kElsewhere;
  };
  for (std::uint32_t& node : blend.node) node = renumbered(node);
  blend.edge.clear();
  for (const implicit::BlendEdge& e : all.edge) {
    const std::uint32_t a = renumbered(e.a), b = renumbered(e.b);
    if (a != kElsewhere && b != kElsewhere) blend.edge.push_back({a, b, e.weight});
  }
  return blend;
}

bool blend_with_each_other(const implicit::Blend& blend, std::uint32_t a, std::uint32_t b) {
  const auto [low, high] = std::minmax(blend.node[a], blend.node[b]);
  const auto at = std::lower_bound(blend.edge.begin(), blend.edge.end(), std::pair(low, high),
                                   [](const implicit::BlendEdge& e, const auto& pair) { return std::pair(e.a, e.b) < pair; });
  return low == high || (at != blend.edge.end() && at->a == low && at->b == high);
}

/// Numbers of things by the particle that carries them, so that a piece is cut out in the time that its own size takes.
class Carried {
 public:
  /// @param part_of  the particle of each thing, counted from the first of the object
  Carried(std::size_t particles, std::size_t things, const auto& part_of) : first_(particles + 1, 0), thing_(things) {
    for (std::size_t k = 0; k < things; ++k) ++first_[part_of(k) + 1];
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    std::vector<std::size_t> place(first_.begin(), first_.end() - 1);
    for (std::size_t k = 0; k < things; ++k) thing_[place[part_of(k)]++] = k;
  }
  /// Those that any of the particles carries, ascending.
  [[nodiscard]] std::vector<std::size_t> of(std::span<const std::uint32_t> particle) const {
    std::vector<std::size_t> out;
    for (const std::uint32_t p : particle) {
      for (std::size_t k = first_[p]; k < first_[p + 1]; ++k) out.push_back(thing_[k]);
    }
    std::sort(out.begin(), out.end());
    return out;
  }

 private:
  std::vector<std::size_t> first_, thing_;
};

/// The primitives and seeds that the particles of a piece carry.
void take_part(const ObjectModel& object, const Carried& primitives, const Carried& seeds, Body& body) {
  std::vector<std::uint32_t> particle;  // ascending, so that a place in it is found by bisection
  for (const std::uint32_t p : body.particle) particle.push_back(p - object.first);
  const auto place = [](const auto& sorted, auto value) {
    return static_cast<std::uint32_t>(std::lower_bound(sorted.begin(), sorted.end(), value) - sorted.begin());
  };

  body.skeleton.part_count = static_cast<std::uint32_t>(body.particle.size());
  body.skeleton.iso = object.skeleton.iso;
  body.skeleton.blend = take_blend(object.skeleton.blend, particle);
  const std::vector<std::size_t> primitive = primitives.of(particle);
  for (const std::size_t k : primitive) {
    implicit::Primitive copy = object.skeleton.primitive[k];
    copy.part = place(particle, copy.part);
    body.skeleton.primitive.push_back(copy);
    if (object.holds_volume) body.primitive.push_back(static_cast<std::uint32_t>(k));
  }
  const implicit::SampleLayout& all = object.samples;
  for (const std::size_t s : seeds.of(particle)) {
    body.samples.primitive.push_back(place(primitive, std::size_t{all.primitive[s]}));
    body.samples.part.push_back(place(particle, all.part[s]));
    body.samples.foot.push_back(all.foot[s]);
    body.samples.direction.push_back(all.direction[s]);
    body.samples.reach.push_back(all.reach[s]);
    body.samples.spread.push_back(all.spread[s]);
    if (object.holds_volume) body.seed.push_back(static_cast<std::uint32_t>(s));
  }
}

void add_particle(const core::ParticleSet& set, std::uint32_t i, Body& body) {
  body.particle.push_back(i);
  body.yield.push_back({core::free_translation(set.pinned[i], Vec3::Constant(1.0 / set.mass[i])).maxCoeff(),
                        core::free_rotation(set.pinned[i], Vec3::Constant(1.0 / set.inertia[i].minCoeff())).maxCoeff()});
}

/// Pairs of groups of an object that may break.
class GroupTies {
 public:
  /// @param led_by  the first particle of the group of each node, or kElsewhere   @param parted  links for the division into bodies
  GroupTies(const Model& model, const ObjectModel& object, std::span<const std::uint32_t> led_by, const core::LinkState& parted)
      : object_(object), led_by_(led_by) {
    for (const implicit::BlendEdge& e : object.skeleton.blend.edge) add(led_by[e.a], led_by[e.b], once_);
    for (const collision::BodyPair& pair : object.bonded) {
      if (object.are_groups(pair)) add(pair.a, pair.b, once_);
    }
    keep_unique(once_);
    for (std::size_t k = 0; k < model.links.size(); ++k) {
      const std::uint32_t p = model.links.first[k], q = model.links.second[k];
      if (p >= object.first && p < object.last && parted.broken[k] == 0) bonds_.push_back({p, q});
    }
    std::sort(bonds_.begin(), bonds_.end());
  }
  /// Pairs within a body that blend, or have a bond between them, at present.
  [[nodiscard]] std::vector<collision::BodyPair> within(const Body& body) const {
    std::vector<collision::BodyPair> pairs;
    const implicit::Blend& blend = body.skeleton.blend;
    std::vector<std::uint32_t> led_by(body.particle.size(), kElsewhere);  // of the body's own nodes
    for (std::size_t i = 0; i < blend.node.size(); ++i) led_by[blend.node[i]] = group_of(body.particle[i]);
    for (const implicit::BlendEdge& e : blend.edge) {
      if (e.weight > 0.0) add(led_by[e.a], led_by[e.b], pairs);
    }
    for (const std::uint32_t p : body.particle) {
      for (auto bond = std::lower_bound(bonds_.begin(), bonds_.end(), collision::BodyPair{p, 0}); bond != bonds_.end() && bond->a == p; ++bond) {
        add(group_of(p), group_of(bond->b), pairs);
      }
    }
    keep_unique(pairs);
    return pairs;
  }
  /// Those that were so before anything broke.
  [[nodiscard]] const std::vector<collision::BodyPair>& once() const { return once_; }

 private:
  static void add(std::uint32_t x, std::uint32_t y, std::vector<collision::BodyPair>& pairs) {
    const auto [a, b] = std::minmax({x, y});
    if (a != b && b != kElsewhere) pairs.push_back({a, b});
  }
  static void keep_unique(std::vector<collision::BodyPair>& pairs) {
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  }
  [[nodiscard]] std::uint32_t group_of(std::uint32_t particle) const { return led_by_[object_.skeleton.blend.node[particle - object_.first]]; }

  const ObjectModel& object_;
  std::span<const std::uint32_t> led_by_;
  std::vector<collision::BodyPair> once_, bonds_;  // of groups; of particles
};

/// What particles of an object carry.
struct CarriedParts {
  const Carried &primitives, &seeds;
};

/// The groups of one object: where it may break, those of a piece that others of it may touch.
void add_groups(const Model& model, const ObjectModel& object, const core::LinkState& parted, const CarriedParts& carried,
                std::span<const Body> whole, std::vector<Body>& groups) {
  const auto& [primitives, seeds] = carried;
  const std::vector<std::uint32_t>& node = object.skeleton.blend.node;
  std::vector<std::uint32_t> led_by(node.size(), kElsewhere);  // nodes are no more than particles
  for (const std::uint32_t first : object.group) led_by[node[first]] = first;
  std::optional<GroupTies> ties;
  if (object.breaks) ties.emplace(model, object, led_by, parted);
  std::vector<Body> own;
  for (const Body& body : whole) {
    std::map<std::uint32_t, std::vector<std::uint32_t>> members;  // particles of each group
    for (const std::uint32_t p : body.particle) {
      const std::uint32_t first = led_by[node[p - object.first]];
      if (first != kElsewhere) members[first].push_back(p);
    }
    std::map<std::uint32_t, std::size_t> tied;  // others that a group may not touch
    std::map<std::uint32_t, std::vector<std::uint32_t>> cut;
    if (ties) {
      const std::vector<collision::BodyPair> now = ties->within(body);
      for (const collision::BodyPair& pair : now) {
        ++tied[pair.a];
        ++tied[pair.b];
      }
      for (const collision::BodyPair& pair : ties->once()) {
        if (!members.contains(pair.a) || !members.contains(pair.b) || std::binary_search(now.begin(), now.end(), pair)) continue;
        cut[pair.a].push_back(pair.b);
        cut[pair.b].push_back(pair.a);
      }
    }
    for (auto& [first, particle] : members) {
      if (ties && tied[first] + 1 >= members.size()) continue;
      std::sort(cut[first].begin(), cut[first].end());
      Body& group = own.emplace_back(Body{.object = body.object,
                                          .origin = {body.origin.piece, body.origin.component, first, std::move(cut[first])},
                                          .name = object.name + ".group" + std::to_string(node[first] + 1),
                                          .particle = {}, .yield = {}, .skeleton = {}, .samples = {}});
      for (const std::uint32_t p : particle) add_particle(model.particles, p, group);
      take_part(object, primitives, seeds, group);
    }
  }
  std::sort(own.begin(), own.end(), [](const Body& a, const Body& b) { return a.particle.front() < b.particle.front(); });
  std::map<std::string, int> named;
  for (Body& group : own) {
    const int number = ++named[group.name];
    if (number > 1) group.name += '.' + std::to_string(number);  // broken objects have several with the same group
  }
  std::move(own.begin(), own.end(), std::back_inserter(groups));
}

}  // namespace

const std::string& body_name(const Model& model, const std::vector<Body>& bodies, std::size_t body) {
  return body < bodies.size() ? bodies[body].name : model.fixed[body - bodies.size()].name;
}

const std::string& object_name(const Model& model, const std::vector<Body>& bodies, std::size_t body) {
  return body < bodies.size() ? model.objects[bodies[body].object].name : body_name(model, bodies, body);
}

core::LinkState parted_links(const Model& model, const core::LinkState& links, std::span<const double> broken_for) {
  core::LinkState parted = links;
  for (std::size_t k = 0; k < broken_for.size(); ++k) {
    const double fade = model.objects[model.particles.object[model.links.first[k]]].fade;
    if (broken_for[k] < fade) parted.broken[k] = 0;
  }
  return parted;
}

void fade_blends(const Model& model, const core::LinkState& links, std::span<const double> broken_for, std::vector<Body>& bodies) {
  for (Body& body : bodies) {
    const ObjectModel& object = model.objects[body.object];
    if (!(object.fade > 0.0)) continue;
    // Weights of the bonds between the particles of the object, in both directions, sorted.
    struct Bond {
      std::uint32_t from, to;
      double weight;
    };
    std::vector<Bond> bonds;
    for (std::size_t k = 0; k < model.links.size(); ++k) {
      const std::uint32_t a = model.links.first[k], b = model.links.second[k];
      if (a < object.first || a >= object.last) continue;
      const double weight = links.broken[k] != 0 ? implicit::fading(broken_for[k], object.fade) : 1.0;
      bonds.push_back({a, b, weight});
      bonds.push_back({b, a, weight});
    }
    std::sort(bonds.begin(), bonds.end(), [](const Bond& x, const Bond& y) { return std::pair(x.from, x.to) < std::pair(y.from, y.to); });
    const auto of = [&](std::uint32_t particle) {
      const auto first = std::lower_bound(bonds.begin(), bonds.end(), particle, [](const Bond& x, std::uint32_t p) { return x.from < p; });
      const auto last = std::find_if(first, bonds.end(), [&](const Bond& x) { return x.from != particle; });
      return std::span<const Bond>(first, last);
    };
    const auto between = [&](std::uint32_t a, std::uint32_t b) {
      double best = 0.0;
      bool any = false;
      for (const Bond& x : of(a)) {
        if (x.to == b) return x.weight;
        for (const Bond& y : of(x.to)) {
          if (y.to != b) continue;
          any = true;
          best = std::max(best, std::min(x.weight, y.weight));
        }
      }
      return any ? best : 1.0;
    };
    implicit::Blend& blend = body.skeleton.blend;
    std::vector<std::vector<std::uint32_t>> members;  // particles by node
    for (std::uint32_t i = 0; i < blend.node.size(); ++i) {
      if (members.size() <= blend.node[i]) members.resize(blend.node[i] + std::size_t{1});
      members[blend.node[i]].push_back(body.particle[i]);
    }
    for (implicit::BlendEdge& e : blend.edge) {
      e.weight = 0.0;
      if (std::max(e.a, e.b) >= members.size()) continue;
      for (const std::uint32_t p : members[e.a]) {
        for (const std::uint32_t q : members[e.b]) e.weight = std::max(e.weight, between(p, q));
      }
    }
  }
}

Meeting meeting_of(const ObjectModel& object, const BodyOrigin& a, const BodyOrigin& b) {
  if (object.separate) return Meeting::Always;
  if (a.is_group() != b.is_group()) return Meeting::Never;
  if (a.is_group()) {
    if (a.piece != b.piece || a.component != b.component) return Meeting::Never;
    if (std::binary_search(a.cut.begin(), a.cut.end(), b.group)) return Meeting::OnceApart;
    if (blend_with_each_other(object.skeleton.blend, a.group, b.group)) return Meeting::Never;
  } else if (a.component == b.component) {
    return Meeting::OnceApart;
  }
  const auto listed = [&](const std::vector<collision::BodyPair>& pairs) {
    const auto [low, high] = std::minmax({a.number(), b.number()});
    return std::binary_search(pairs.begin(), pairs.end(), collision::BodyPair{low, high});
  };
  if (listed(object.bonded)) return a.piece == b.piece ? Meeting::Never : Meeting::OnceApart;
  return listed(object.overlapping) ? Meeting::OnceApart : Meeting::Always;
}

std::uint32_t leader_of(const Model& model, const Body& body) {
  const bool shared = body.origin.is_group() && model.objects[body.object].breaks;
  return body.particle.front() + (shared ? static_cast<std::uint32_t>(model.particles.size()) : 0);
}

std::vector<Body> make_bodies(const Model& model, const core::LinkState& links, std::span<const double> broken_for) {
  const core::LinkState parted = parted_links(model, links, broken_for);
  std::vector<std::uint32_t> piece = core::find_pieces(model.particles, model.links, parted);
  for (const ObjectModel& object : model.objects) {
    if (object.separate) std::iota(piece.begin() + object.first, piece.begin() + object.last, object.first);
  }
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> body_of;  // by piece and component, of one object
  std::vector<Body> bodies, groups, own;
  for (std::uint32_t o = 0; o < model.objects.size(); ++o) {
    const ObjectModel& object = model.objects[o];
    own.clear();
    body_of.clear();
    for (std::uint32_t i = object.first; i < object.last; ++i) {
      const BodyOrigin origin{piece[i], object.component.empty() ? 0 : object.component[i - object.first]};
      const auto [place, fresh] = body_of.try_emplace({origin.piece, origin.component}, own.size());
      if (fresh) {
        own.push_back({.object = o, .origin = origin, .name = object.name, .particle = {}, .yield = {}, .skeleton = {}, .samples = {}});
      }
      add_particle(model.particles, i, own[place->second]);
    }
    const std::uint32_t particles = object.last - object.first;
    const auto& primitive = object.skeleton.primitive;
    const Carried primitives(particles, primitive.size(), [&](std::size_t k) { return primitive[k].part; });
    const Carried seeds(particles, object.samples.size(), [&](std::size_t s) { return object.samples.part[s]; });
    for (std::size_t k = 0; k < own.size(); ++k) {
      if (own.size() > 1) own[k].name += '.' + std::to_string(k + 1);
      take_part(object, primitives, seeds, own[k]);
    }
    fade_blends(model, links, broken_for, own);
    if (!object.group.empty()) add_groups(model, object, parted, {primitives, seeds}, own, groups);
    std::move(own.begin(), own.end(), std::back_inserter(bodies));
  }
  std::move(groups.begin(), groups.end(), std::back_inserter(bodies));
  return bodies;
}

std::size_t surface_count(const std::vector<Body>& bodies) {
  const auto whole = std::partition_point(bodies.begin(), bodies.end(), [](const Body& body) { return !body.origin.is_group(); });
  return static_cast<std::size_t>(whole - bodies.begin());
}

collision::ContactRules make_body_rules(const Model& model, const std::vector<Body>& bodies, const ApartPairs& apart) {
  const auto count = static_cast<std::uint32_t>(bodies.size() + model.fixed.size());
  std::vector<std::uint32_t> object(count), leader(count, kElsewhere);
  std::vector<BodyOrigin> origin;
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    object[k] = bodies[k].object;
    leader[k] = leader_of(model, bodies[k]);
    origin.push_back(bodies[k].origin);
  }
  for (std::size_t k = bodies.size(); k < count; ++k) {
    object[k] = static_cast<std::uint32_t>(model.objects.size() + k - bodies.size());
  }

  collision::ContactRules rules;
  if (!model.rules.overrides.empty()) {
    std::vector<std::vector<std::uint32_t>> of_object(model.objects.size() + model.fixed.size());
    for (std::uint32_t k = 0; k < count; ++k) of_object[object[k]].push_back(k);
    for (const auto& override : model.rules.overrides) {
      for (const std::uint32_t a : of_object[override.pair.a]) {
        for (const std::uint32_t b : of_object[override.pair.b]) rules.overrides.push_back({{a, b}, override.material});
      }
    }
  }
  std::sort(rules.overrides.begin(), rules.overrides.end(),
            [](const auto& x, const auto& y) { return x.pair < y.pair; });
  rules.allowed = [&model, &objects = model.objects, object, leader, origin, apart](std::uint32_t a, std::uint32_t b) {
    if (object[a] != object[b]) {
      const auto is_group = [&](std::uint32_t body) { return body < origin.size() && origin[body].is_group(); };
      return !is_group(a) && !is_group(b) && may_touch(model, object[a], object[b]);
    }
    const Meeting meeting = meeting_of(objects[object[a]], origin[a], origin[b]);
    if (meeting != Meeting::OnceApart) return meeting == Meeting::Always;
    return std::binary_search(apart.begin(), apart.end(),
                              collision::BodyPair{std::min(leader[a], leader[b]), std::max(leader[a], leader[b])});
  };
  return rules;
}

}  // namespace supple::scenes
