#include "supple/render/colour_map.h"

#include <algorithm>
#include <cstddef>

namespace supple::render {
namespace {

// sRGB (0xrrggbb) at equal steps, from the published tables; values between are interpolated.
constexpr std::size_t kStops = 17;
constexpr std::uint32_t kStopColours[kColourMapNames.size()][kStops] = {
    {0x440154, 0x48186a, 0x472d7b, 0x424086, 0x3b528b, 0x33638d, 0x2c728e, 0x26828e, 0x21918c,
     0x1fa088, 0x28ae80, 0x3fbc73, 0x5ec962, 0x84d44b, 0xaddc30, 0xd8e219, 0xfde725},
    {0x000004, 0x0a0822, 0x1d1147, 0x36106b, 0x51127c, 0x6a1c81, 0x832681, 0x9c2e7f, 0xb73779,
     0xd0416f, 0xe75263, 0xf56b5c, 0xfc8961, 0xfea772, 0xfec488, 0xfde2a3, 0xfcfdbf},
    {0x3b4cc0, 0x4e68d8, 0x6282ea, 0x779af7, 0x8db0fe, 0xa3c2fe, 0xb9d0f9, 0xccd9ed, 0xdddcdc,
     0xecd3c5, 0xf5c4ac, 0xf7b093, 0xf4987a, 0xeb7d62, 0xdd5f4b, 0xca3b37, 0xb40426},
    {0x30123b, 0x4040a2, 0x466be3, 0x4294ff, 0x28bceb, 0x18ddc2, 0x32f298, 0x6dfe62, 0xa4fc3c,
     0xcdec34, 0xeecf3a, 0xfdac34, 0xfb7e21, 0xeb500e, 0xd02f05, 0xa91601, 0x7a0403},
    {0x000000, 0x101010, 0x202020, 0x303030, 0x404040, 0x505050, 0x606060, 0x707070, 0x808080,
     0x8f8f8f, 0x9f9f9f, 0xafafaf, 0xbfbfbf, 0xcfcfcf, 0xdfdfdf, 0xefefef, 0xffffff},
};

Vec3 stop(ColourMap map, std::size_t k) {
  const std::uint32_t rgb = kStopColours[static_cast<std::size_t>(map)][k];
  return Vec3((rgb >> 16) & 255, (rgb >> 8) & 255, rgb & 255) / 255.0;
}

}  // namespace

Vec3 colour_of(ColourMap map, double t) {
  const double at = (t > 0.0 ? std::min(t, 1.0) : 0.0) * (kStops - 1);  // NaN is below
  const std::size_t k = std::min(static_cast<std::size_t>(at), kStops - 2);
  const double rest = at - static_cast<double>(k);
  return (1.0 - rest) * stop(map, k) + rest * stop(map, k + 1);
}

}  // namespace supple::render
