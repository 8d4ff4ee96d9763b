/// @file solve.h
/// Primitives of a summed field, moved and resized until its surface is the data.
#pragma once

#include <span>
#include <vector>

#include "fit/samples.h"
#include "supple/implicit/field.h"

namespace supple::fit {

inline constexpr double kPointRadius = 0.45420201867;  ///< of a lone point's surface at iso 0.5, over that of its support

enum class Form : std::uint8_t {
  Ball,
  Ellipsoid,
  Segment,  ///< a rod with round ends
};

/// A primitive f = (1 - u)^3 with Wyvill's kernel, y = Q^T (x - c): of an ellipsoid u = |D^-1 y|^2, of a segment the square of the distance to it over the radius.
struct Blob {
  Vec3 centre = Vec3::Zero();
  Vec3 axes = Vec3::Zero();         ///< semi-axes of the support D, all equal for a ball; of a segment half its length along x, then twice the radius of the support
  Quat turn = Quat::Identity();     ///< Q
  Form form = Form::Ball;
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
  double largest = 0.0;    ///< of these; the surface of a segment is no longer than that of such a ball
  std::vector<char> fixed{};  ///< which blobs stay as they are; empty: none
};

inline constexpr int kBlobParameters = 9;  ///< centre, logarithms of the axes, rotation about own axes; balls have the first four
using BlobStep = Eigen::Matrix<double, kBlobParameters, 1>;

/// f at a point and its derivatives by the parameters.
struct BlobValue {
  double value = 0.0;
  BlobStep slope = BlobStep::Zero();
};
[[nodiscard]] BlobValue value_of(const Blob& blob, const Vec3& x);
/// Moved by a step of its parameters, at most by a share of its size, and of sizes within the options.
[[nodiscard]] Blob moved(const Blob& blob, const BlobStep& step, const SolveOptions& options);

/// Scales every blob so that the field is that of the data on average over what it reaches: a start for `solve` where overlapping blobs add up to too much. By
/// simultaneous corrections (SIRT, Gilbert 1972), each the share of a blob in the error of the field over the slopes of all by their sizes.
void balance(std::vector<Blob>& blobs, const Targets& targets, const SolveOptions& options, const Executor& executor);

/// Levenberg and Marquardt's method on distances F / |grad F|, angles of normals and signs; linear systems by conjugate gradients with the blocks of the blobs as
/// preconditioner. The same bits for any number of threads.
/// @return the root mean square of the distances
double solve(std::vector<Blob>& blobs, const Targets& targets, const SolveOptions& options, const Executor& executor);

}  // namespace supple::fit
