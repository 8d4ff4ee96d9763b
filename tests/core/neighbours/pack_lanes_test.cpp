// Marked lanes brought to the front, against a loop.
#define HWY_DISABLE_PCLMUL_AES

#include "neighbours/pack_lanes-inl.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>

namespace supple::HWY_NAMESPACE {
namespace {

template <class D>
void expect_packed(D d) {
  using T = hn::TFromD<D>;
  constexpr std::size_t kLanes = hn::MaxLanes(D());
  std::array<T, kLanes> from{};
  for (std::size_t i = 0; i < kLanes; ++i) from[i] = static_cast<T>(100 + i);
  for (unsigned mask = 0; mask < 1u << kLanes; ++mask) {
    const std::array<std::uint8_t, 8> bits{static_cast<std::uint8_t>(mask), static_cast<std::uint8_t>(mask >> 8)};
    std::array<T, kLanes> found{};
    hn::StoreU(pack_lanes(hn::LoadU(d, from.data()), hn::LoadMaskBits(d, bits.data())), d, found.data());
    std::size_t place = 0;
    for (std::size_t i = 0; i < kLanes; ++i) {
      if ((mask >> i & 1u) == 0) continue;
      ASSERT_EQ(found[place++], from[i]) << mask;
    }
    ASSERT_EQ(place, static_cast<std::size_t>(std::popcount(mask)));
  }
}

TEST(PackLanes, BringsThoseMarkedToTheFrontInTheirOrder) {
  expect_packed(hn::CappedTag<float, 8>());
  expect_packed(hn::CappedTag<float, 4>());
  expect_packed(hn::CappedTag<std::uint32_t, 8>());
  expect_packed(hn::CappedTag<std::uint32_t, 4>());
}

}  // namespace
}  // namespace supple::HWY_NAMESPACE
