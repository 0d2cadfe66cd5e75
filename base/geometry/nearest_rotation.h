// The rotation nearest to a matrix.
#pragma once

#include <Eigen/Core>

namespace v3d {

/// The rotation nearest to a matrix in the Frobenius norm. Of the covariance of two sets of
/// directions: the rotation that brings one to the other in the least squares sense.
///
/// Source: Kabsch, A solution for the best rotation to relate two sets of vectors, Acta
/// Crystallographica A32, 1976.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix);

}  // namespace v3d
