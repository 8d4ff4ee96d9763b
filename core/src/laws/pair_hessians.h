// The Hessians of all pairs of a scene, one after the other.
#pragma once

#include <functional>

#include "supple/core/interactions.h"
#include "supple/core/pair_hessian.h"

namespace supple::core {

using PairHessianVisitor = std::function<void(std::uint32_t a, std::uint32_t b, const PairHessian& h)>;

/// Calls visit(a, b, H) for every pair of every law, in the order of `potential_energy`.
void for_each_hessian(const ParticleSet& set, const ParticleState& state, const Interactions& interactions,
                      HessianKind kind, const PairHessianVisitor& visit);

}  // namespace supple::core
