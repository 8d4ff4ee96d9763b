#include "supple/collision/bodies.h"

#include <algorithm>

#include <cmath>

namespace supple::collision {

PairMaterial combine(const ContactMaterial& a, const ContactMaterial& b) {
  return {.friction = std::sqrt(a.friction * b.friction),
          .dissipation = (a.dissipation * b.modulus + b.dissipation * a.modulus) / (a.modulus + b.modulus)};
}

PairMaterial material_of(std::span<const ContactBody> bodies, const ContactRules& rules, const BodyPair& pair) {
  const auto found = std::lower_bound(rules.overrides.begin(), rules.overrides.end(), pair,
                                      [](const ContactRules::Override& o, const BodyPair& p) { return o.pair < p; });
  if (found != rules.overrides.end() && found->pair == pair) return found->material;
  return combine(bodies[pair.a].material, bodies[pair.b].material);
}

}  // namespace supple::collision
