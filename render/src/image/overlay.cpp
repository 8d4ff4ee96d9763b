#include "supple/render/overlay.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "supple/core/error.h"

namespace supple::render {
namespace {

using Point = Eigen::Vector2d;

/// Strokes of a character, each a row of points: x a digit, y a letter from a (-2) over c, the base line, and g (4), the
/// top of a small letter, to i (6). A stroke that begins with ~ is rounded.
struct Glyph {
  char character;
  const char* strokes;
};
constexpr Glyph kGlyphs[] = {
    {'0', "~1c3c4d4h3i1i0h0d1c"}, {'1', "0h2i2c"}, {'2', "~0h1i3i4h4g3f0c 0c4c"},
    {'3', "~0h1i3i4h4g3f1f ~1f3f4e4d3c1c0d"}, {'4', "3c3i0e4e"}, {'5', "4i0i0f ~0f3f4e4d3c1c0d"},
    {'6', "~4h3i1i0h0d1c3c4d4e3f1f0e"}, {'7', "0i4i1c"}, {'8', "~1f3f4g4h3i1i0h0g1f ~1f3f4e4d3c1c0d0e1f"},
    {'9', "~0d1c3c4d4h3i1i0h0g1f3f4g"}, {'.', "1c1c"}, {'-', "0e4e"}, {'+', "0e4e 2c2g"}, {'/', "0b4i"},
    {'[', "3i1i1b3b"}, {']', "0i2i2b0b"}, {'(', "~2i1g1d2b"}, {')', "~0i1g1d0b"},
    {'a', "~4f3g1g0f0d1c3c4d 4g4c"}, {'b', "0i0c ~0f1g3g4f4d3c1c0d"}, {'c', "~4f3g1g0f0d1c3c4d"},
    {'d', "4i4c ~4f3g1g0f0d1c3c4d"}, {'e', "0e4e ~4e4f3g1g0f0d1c3c4d"}, {'f', "~3i2i1h1g 1g1c 0g3g"},
    {'g', "~4f3g1g0f0d1c3c4d 4g4c ~4c4b3a1a0b"}, {'h', "0i0c ~0f1g3g4f4e 4e4c"}, {'i', "1g1c 1i1i"},
    {'j', "~2g2b1a0a 2i2i"}, {'k', "0i0c 3g0e 1e3c"}, {'l', "1i1c"}, {'m', "0g0c ~0f1g2g3f3e 3e3c ~3f4g5g6f6e 6e6c"},
    {'n', "0g0c ~0f1g3g4f4e 4e4c"}, {'o', "~1c3c4d4f3g1g0f0d1c"}, {'p', "0g0a ~0f1g3g4f4d3c1c0d"},
    {'q', "4g4a ~4f3g1g0f0d1c3c4d"}, {'r', "0g0c ~0f1g2g3g"}, {'s', "~4f3g1g0f1e3e4d3c1c0d"},
    {'t', "1i1d ~1d2c3c 0g3g"}, {'u', "0g0e ~0e0d1c3c4d 4g4c"}, {'v', "0g2c4g"}, {'w', "0g1c3g5c6g"},
    {'x', "0g4c 0c4g"}, {'y', "0g2c 4g1a"}, {'z', "0g4g0c4c"}, {'P', "0c0i ~0i3i4h4g3f0f"}};
constexpr double kCapHeight = 6.0;   // in units of the strokes' grid
constexpr double kGap = 1.8;         // between characters
constexpr double kPenRadius = 0.42;

const char* strokes_of(char character) {
  for (const Glyph& glyph : kGlyphs)
    if (glyph.character == character) return glyph.strokes;
  return "";
}

double advance(char character) {
  double widest = -1.0;
  for (const char* c = strokes_of(character); *c != '\0'; ++c)
    if (*c >= '0' && *c <= '9') widest = std::max(widest, static_cast<double>(*c - '0'));
  return (widest < 0.0 ? 2.0 : widest) + kGap;
}

/// Cuts corners once (Chaikin 1974); ends stay.
std::vector<Point> rounded(const std::vector<Point>& stroke) {
  const bool closed = stroke.size() > 2 && stroke.front() == stroke.back();
  std::vector<Point> out;
  if (!closed) out.push_back(stroke.front());
  for (std::size_t i = 0; i + 1 < stroke.size(); ++i) {
    out.push_back(0.75 * stroke[i] + 0.25 * stroke[i + 1]);
    out.push_back(0.25 * stroke[i] + 0.75 * stroke[i + 1]);
  }
  out.push_back(closed ? out.front() : stroke.back());
  return out;
}

std::vector<std::vector<Point>> parse(const char* text) {
  std::vector<std::vector<Point>> strokes;
  bool round = false;
  const auto finish = [&] {
    if (round && !strokes.empty()) strokes.back() = rounded(rounded(strokes.back()));
    round = false;
  };
  bool fresh = true;
  for (const char* c = text; *c != '\0'; ++c) {
    if (*c == ' ') {
      finish();
      fresh = true;
      continue;
    }
    if (fresh) strokes.emplace_back();
    fresh = false;
    if (*c == '~') {
      round = true;
      continue;
    }
    strokes.back().emplace_back(*c - '0', c[1] - 'c');
    ++c;
  }
  finish();
  return strokes;
}

double distance(const Point& p, const Point& a, const Point& b) {
  const Point d = b - a;
  const double length2 = d.squaredNorm();
  const double t = length2 > 0.0 ? std::clamp((p - a).dot(d) / length2, 0.0, 1.0) : 0.0;
  return (p - a - t * d).norm();
}

void mix(Image& image, int x, int y, const Vec3& colour, double share) {
  if (x < 0 || y < 0 || x >= image.width || y >= image.height || share <= 0.0) return;
  std::uint8_t* out = &image.pixels[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                                         static_cast<std::size_t>(x))];
  for (int k = 0; k < 3; ++k)
    out[k] = static_cast<std::uint8_t>(std::lround(out[k] + std::min(share, 1.0) * (255.0 * colour[k] - out[k])));
}

/// Share of the pixel between two borders along one axis.
double covered(int pixel, double lower, double upper) {
  return std::clamp(std::min(pixel + 1.0, upper) - std::max(static_cast<double>(pixel), lower), 0.0, 1.0);
}

/// Sides of a rectangle [pixels].
struct Sides {
  double left, top, right, bottom;
};

/// @param share  of the new colour  @param colour  of a row of pixels
template <class Colour>
void fill(Image& image, const Sides& at, double share, const Colour& colour) {
  for (int y = static_cast<int>(std::floor(at.top)); y < at.bottom; ++y)
    for (int x = static_cast<int>(std::floor(at.left)); x < at.right; ++x)
      mix(image, x, y, colour(y), share * covered(x, at.left, at.right) * covered(y, at.top, at.bottom));
}

std::string number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.6g", value == 0.0 ? 0.0 : value);
  return text.data();
}

/// Draws one bar whose panel ends at `right`; returns where it begins.
double draw_scale_bar(Image& image, const ScaleBar& bar, double right) {
  const double text = std::max(image.height / 48.0, 7.0);
  const double margin = 0.9 * text;
  const double length = 0.42 * image.height;
  const double width = 1.1 * text;
  const std::vector<double> marks = ticks(bar.lower, bar.upper, 6);
  double label = 0.0;
  for (const double mark : marks) label = std::max(label, text_width(number(mark), text));
  const double panel = std::max(width + 0.6 * text + label, text_width(bar.title, text)) + 2.0 * margin;
  const double left = right - panel;
  const double top = 0.5 * (image.height - length) + 1.2 * text;
  const double bottom = top + length;

  fill(image, {left, top - 2.0 * text - margin, right, bottom + margin}, 0.72, [](int) { return Vec3(1, 1, 1); });
  draw_text(image, left + margin, top - 1.2 * text, text, bar.title);
  const double begin = left + margin;
  fill(image, {begin, top, begin + width, bottom}, 1.0,
       [&](int y) { return colour_of(bar.map, (bottom - (y + 0.5)) / length); });
  for (const double mark : marks) {
    const double y = bottom - length * (mark - bar.lower) / (bar.upper - bar.lower);
    fill(image, {begin + width, y - 0.05 * text, begin + width + 0.3 * text, y + 0.05 * text}, 1.0,
         [](int) { return Vec3(0.1, 0.1, 0.1); });
    draw_text(image, begin + width + 0.6 * text, y + 0.5 * text, text, number(mark));
  }
  return left;
}

}  // namespace

double text_width(std::string_view text, double height) {
  double width = 0.0;
  for (const char c : text) width += advance(c);
  return text.empty() ? 0.0 : (width - kGap + 2.0 * kPenRadius) * height / kCapHeight;
}

void draw_text(Image& image, double x, double y, double height, std::string_view text, double brightness) {
  const double unit = height / kCapHeight;
  const double pen = std::max(kPenRadius * unit, 0.5);
  const Vec3 ink = Vec3::Constant(brightness);
  for (const char c : text) {
    const std::vector<std::vector<Point>> strokes = parse(strokes_of(c));
    const int first_x = static_cast<int>(std::floor(x - 2.0)), last_x = static_cast<int>(std::ceil(x + 6.0 * unit + 3.0));
    const int first_y = static_cast<int>(std::floor(y - 6.0 * unit - 3.0)), last_y = static_cast<int>(std::ceil(y + 2.0 * unit + 3.0));
    for (int py = first_y; !strokes.empty() && py <= last_y; ++py)
      for (int px = first_x; px <= last_x; ++px) {
        const Point at((px + 0.5 - x) / unit - kPenRadius, (y - py - 0.5) / unit);
        double nearest = 1e9;
        for (const auto& stroke : strokes)
          for (std::size_t i = 0; i + 1 < stroke.size(); ++i) nearest = std::min(nearest, distance(at, stroke[i], stroke[i + 1]));
        mix(image, px, py, ink, pen + 0.5 - nearest * unit);
      }
    x += advance(c) * unit;
  }
}

std::vector<double> ticks(double lower, double upper, int most) {
  SUPPLE_EXPECTS(lower < upper && most >= 3);
  const double range = upper - lower;
  double power = std::pow(10.0, std::floor(std::log10(range)) - 1.0);
  std::vector<double> out;
  for (;; power *= 10.0)
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double step = factor * power;
      const double first = std::ceil(lower / step - 1e-9), last = std::floor(upper / step + 1e-9);
      if (last - first + 1.0 > most) continue;
      for (double k = first; k <= last; k += 1.0) out.push_back(k * step);
      if (out.size() < 2) out = {lower, upper};
      return out;
    }
}

void draw_scale_bars(Image& image, std::span<const ScaleBar> bars) {
  if (image.height < 120 || image.width < 120) return;
  const double gap = image.height / 60.0;
  double right = image.width - gap;
  for (const ScaleBar& bar : bars) right = draw_scale_bar(image, bar, right) - gap;
}

}  // namespace supple::render
