/// @file solve.h
/// Primitives of a summed field, moved and resized until its surface is the data.
#pragma once

#include <span>
#include <vector>

#include "fit/samples.h"
#include "supple/implicit/field.h"

namespace supple::fit {

/// Wyvill's kernel on an ellipsoid: f = (1 - |D^-1 Q^T (x - c)|^2)^3.
struct Blob {
  Vec3 centre = Vec3::Zero();
  Vec3 axes = Vec3::Zero();         ///< semi-axes of the support D, all equal where `round`
  Quat turn = Quat::Identity();     ///< Q
  bool round = true;
};

/// The field of blobs, each a part of its own, with the kernels of scenes.
[[nodiscard]] implicit::Skeleton skeleton_of(std::span<const Blob> blobs);
void build_field(std::span<const Blob> blobs, implicit::Field& field);

/// Points where the sign of the field is known.
struct SignPoints {
  std::vector<Vec3> position;
  std::vector<double> weight;  ///< distance that a wrong sign counts as

  void add(const Vec3& p, double w) {
    position.push_back(p);
    weight.push_back(w);
  }
};

/// Where the field is compared with the data.
struct Targets {
  SurfaceSamples surface;               ///< F = 0, with the normals
  std::vector<double> size;             ///< radius of the ball that touches the surface at a sample: the slope of the field is about 0.8 / size
  SignPoints inside, outside;           ///< F > 0 and F < 0
};

struct SolveOptions {
  int iterations = 10;
  double smallest = 0.0;   ///< of semi-axes of the support
  double largest = 0.0;
};

/// Scales every blob so that the field is that of the data on average over what it reaches: a start for `solve` where overlapping blobs add up to too much. By
/// simultaneous corrections (SIRT, Gilbert 1972), each the share of a blob in the error of the field over the slopes of all by their sizes.
void balance(std::vector<Blob>& blobs, const Targets& targets, const SolveOptions& options, const Executor& executor);

/// Levenberg and Marquardt's method on distances F / |grad F|, angles of normals and signs; linear systems by conjugate gradients with the blocks of the blobs as
/// preconditioner. The same bits for any number of threads.
/// @return the root mean square of the distances
double solve(std::vector<Blob>& blobs, const Targets& targets, const SolveOptions& options, const Executor& executor);

}  // namespace supple::fit
