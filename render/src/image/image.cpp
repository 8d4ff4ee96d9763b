#include "supple/render/image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "image/srgb.h"
#include "supple/core/error.h"

namespace supple::render {
namespace {

/// Source pixels under one target pixel along an axis, with the share of the target that each covers.
struct Span {
  int first = 0;
  std::vector<double> weight;
};

std::vector<Span> coverage(int source, int target) {
  std::vector<Span> spans(static_cast<std::size_t>(target));
  const double ratio = static_cast<double>(source) / target;
  for (int t = 0; t < target; ++t) {
    const double lower = t * ratio;
    const double upper = std::min((t + 1) * ratio, static_cast<double>(source));
    Span& span = spans[static_cast<std::size_t>(t)];
    span.first = static_cast<int>(lower);
    for (int s = span.first; s < upper && s < source; ++s)
      span.weight.push_back((std::min(upper, s + 1.0) - std::max(lower, static_cast<double>(s))) / ratio);
  }
  return spans;
}

std::size_t index(const Image& image, int x, int y) {
  return 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x));
}

bool well_formed(const Image& image) {
  return image.width > 0 && image.height > 0 && image.pixels.size() == index(image, 0, image.height);
}

}  // namespace

Image downscale(const Image& image, int width) {
  SUPPLE_EXPECTS(well_formed(image));
  SUPPLE_EXPECTS(width >= 1 && width <= image.width);
  const double proportion = static_cast<double>(image.height) * width / image.width;
  Image out{.width = width, .height = std::max(1, static_cast<int>(std::lround(proportion))), .pixels = {}};
  out.pixels.resize(index(out, 0, out.height));

  const std::vector<Span> columns = coverage(image.width, out.width);
  const std::vector<Span> rows = coverage(image.height, out.height);
  const std::array<double, 256>& linear = linear_of_srgb();
  for (int y = 0; y < out.height; ++y) {
    const Span& row = rows[static_cast<std::size_t>(y)];
    for (int x = 0; x < out.width; ++x) {
      const Span& column = columns[static_cast<std::size_t>(x)];
      std::array<double, 3> sum{};
      for (std::size_t j = 0; j < row.weight.size(); ++j) {
        const std::uint8_t* pixel = &image.pixels[index(image, column.first, row.first + static_cast<int>(j))];
        for (std::size_t i = 0; i < column.weight.size(); ++i)
          for (std::size_t c = 0; c < 3; ++c) sum[c] += row.weight[j] * column.weight[i] * linear[pixel[3 * i + c]];
      }
      for (std::size_t c = 0; c < 3; ++c) out.pixels[index(out, x, y) + c] = srgb_of_linear(sum[c]);
    }
  }
  return out;
}

Image contact_sheet(std::span<const Image> images, int columns, int gap) {
  SUPPLE_EXPECTS(!images.empty());
  SUPPLE_EXPECTS(columns >= 1 && gap >= 0);
  const Image& first = images.front();
  for (const Image& image : images)
    SUPPLE_EXPECTS(well_formed(image) && image.width == first.width && image.height == first.height);

  const int count = static_cast<int>(images.size());
  const int across = std::min(columns, count);
  const int down = (count + columns - 1) / columns;
  Image sheet{.width = gap + across * (first.width + gap), .height = gap + down * (first.height + gap), .pixels = {}};
  sheet.pixels.assign(index(sheet, 0, sheet.height), 255);
  for (int i = 0; i < count; ++i) {
    const Image& image = images[static_cast<std::size_t>(i)];
    const int left = gap + (i % columns) * (first.width + gap);
    const int top = gap + (i / columns) * (first.height + gap);
    for (int y = 0; y < image.height; ++y)
      std::copy_n(&image.pixels[index(image, 0, y)], 3 * static_cast<std::size_t>(image.width),
                  &sheet.pixels[index(sheet, left, top + y)]);
  }
  return sheet;
}

ImageDifference compare(const Image& a, const Image& b, double gain) {
  SUPPLE_EXPECTS(well_formed(a) && a.width == b.width && a.height == b.height && b.pixels.size() == a.pixels.size());
  SUPPLE_EXPECTS(gain > 0.0);
  ImageDifference out{.picture = a};
  double squares = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    const int difference = std::abs(a.pixels[i] - b.pixels[i]);
    out.largest = std::max(out.largest, difference);
    squares += difference * difference;
    out.picture.pixels[i] = static_cast<std::uint8_t>(std::min(255L, std::lround(gain * difference)));
  }
  const double mean = squares / static_cast<double>(a.pixels.size());
  out.psnr = mean > 0.0 ? 10.0 * std::log10(255.0 * 255.0 / mean) : std::numeric_limits<double>::infinity();
  return out;
}

}  // namespace supple::render
