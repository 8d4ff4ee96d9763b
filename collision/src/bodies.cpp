#include "supple/collision/bodies.h"

#include <cmath>

namespace supple::collision {

PairMaterial combine(const ContactMaterial& a, const ContactMaterial& b) {
  return {.friction = std::sqrt(a.friction * b.friction),
          .dissipation = (a.dissipation * b.modulus + b.dissipation * a.modulus) / (a.modulus + b.modulus)};
}

}  // namespace supple::collision
