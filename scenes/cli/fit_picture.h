/// @file fit_picture.h
/// A picture of data and fit.
#pragma once

#include <filesystem>

#include "supple/fit/fit.h"

namespace supple::tool {

/// Data on the left, fit on the right, with the distances of each to the other: from none (dark) to the error asked (yellow). Seen along the shortest side of
/// their box. @param error  over the diagonal
void draw_fit(const fit::FittedObject& object, double error, const std::filesystem::path& file);

}  // namespace supple::tool
