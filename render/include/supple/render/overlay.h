/// @file supple/render/overlay.h
/// Text and scale bars of colour maps over a finished picture.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "supple/render/colour_map.h"
#include "supple/render/image.h"

namespace supple::render {

/// Draws text of lower case letters, P, digits and .-+/()[] with round, smooth strokes; other characters are blank.
/// @param x, y       left end of the base line [pixel, y downward]
/// @param height     of a digit [pixel]
/// @param brightness of the ink, sRGB in [0, 1]
void draw_text(Image& image, double x, double y, double height, std::string_view text, double brightness = 0.1);
/// Width of a text of this height [pixel].
[[nodiscard]] double text_width(std::string_view text, double height);

/// The meaning of a colour map.
struct ScaleBar {
  ColourMap map = ColourMap::Viridis;
  double lower = 0.0;
  double upper = 1.0;
  std::string title;    ///< with the unit, e.g. "pressure [Pa]"
  bool operator==(const ScaleBar&) const = default;
};

/// Round numbers (1, 2 or 5 times a power of ten apart) in [lower, upper], at most `most` of them but at least two.
/// @pre lower < upper, most >= 3
[[nodiscard]] std::vector<double> ticks(double lower, double upper, int most);

/// Draws the bars side by side on pale panels at the right border. Pictures of less than 120 pixels get none.
void draw_scale_bars(Image& image, std::span<const ScaleBar> bars);

}  // namespace supple::render
