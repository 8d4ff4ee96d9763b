/// @file supple/core/io/number_range.h
/// Sizes of the numbers in scenes, tables and meshes.
#pragma once

namespace supple::io {

/// Numbers that are not zero lie between these in size: products of six of them are still finite, and so are their inverses. Coordinates in tables and meshes
/// may be smaller.
inline constexpr double kSmallestNumber = 1e-50;
inline constexpr double kLargestNumber = 1e50;

}  // namespace supple::io
