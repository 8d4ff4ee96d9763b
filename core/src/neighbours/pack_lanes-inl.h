// Marked lanes of 32 bits brought to the front, in their order. Included once for each width.
#if defined(SUPPLE_PACK_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SUPPLE_PACK_LANES_INL_H
#undef SUPPLE_PACK_LANES_INL_H
#else
#define SUPPLE_PACK_LANES_INL_H
#endif

#include <hwy/highway.h>

#include <array>
#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace supple::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_AVX2

/// By mask of eight lanes: those marked, then the others, four bits each.
constexpr std::array<std::uint32_t, 256> orders_of_lanes() {
  std::array<std::uint32_t, 256> orders{};
  for (std::uint32_t mask = 0; mask < 256; ++mask) {
    std::uint32_t place = 0;
    for (const std::uint32_t wanted : {1u, 0u}) {
      for (std::uint32_t lane = 0; lane < 8; ++lane) {
        if ((mask >> lane & 1u) == wanted) orders[mask] |= lane << 4 * place++;
      }
    }
  }
  return orders;
}
inline constexpr std::array<std::uint32_t, 256> kOrdersOfLanes = orders_of_lanes();

/// As Highway's Compress, whose table GCC copies to the stack for each call with AVX2.
template <class Lanes, class Marks>
HWY_INLINE Lanes pack_lanes(Lanes lanes, Marks keep) {
  const hn::DFromV<Lanes> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  static_assert(sizeof(hn::TFromD<decltype(d)>) == 4 && hn::MaxLanes(d) <= 8);
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(d, keep, bits);
  const auto order = hn::Shr(hn::Set(du, kOrdersOfLanes[bits[0]]), hn::ShiftLeft<2>(hn::Iota(du, 0)));
  const auto index = hn::IndicesFromVec(du, hn::And(order, hn::Set(du, 7)));
  return hn::BitCast(d, hn::TableLookupLanes(hn::BitCast(du, lanes), index));
}

#else

template <class Lanes, class Marks>
HWY_INLINE Lanes pack_lanes(Lanes lanes, Marks keep) {
  return hn::Compress(lanes, keep);
}

#endif

}  // namespace supple::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
