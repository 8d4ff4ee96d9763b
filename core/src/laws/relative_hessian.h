// Second derivatives of a pair's energy in y = (dr, dtheta_A, dtheta_B), dr = dx_B - dx_A.
#pragma once

#include "supple/core/pair_hessian.h"

namespace supple::core {

using Vec9 = Eigen::Matrix<double, 9, 1>;
using Mat9 = Eigen::Matrix<double, 9, 9>;

/// Places in y.
enum : int { kR = 0, kTurnA = 3, kTurnB = 6 };

[[nodiscard]] PairHessian from_relative(const Mat9& second);

}  // namespace supple::core
