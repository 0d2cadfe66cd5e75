// How the colours of one camera are brought to the common response of its rig.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>

#include "base/image/image.h"

namespace v3d {

/// Of linear light, as machine vision cameras give it (gamma off): what a camera shows, in grey
/// values 0 to 255, less its black level, times a matrix that holds its gain, its white balance and
/// the cross-talk of its filters.
struct ColourResponse {
  Eigen::Vector3d black = Eigen::Vector3d::Zero();       ///< grey values of R, G, B without light
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();  ///< common R, G, B from the camera's

  bool is_identity() const { return black.isZero(0) && matrix.isIdentity(0); }
  /// What the others would show; may lie outside 0 to 255.
  Eigen::Vector3d corrected(const Eigen::Vector3d& grey) const { return matrix * (grey - black); }
  /// From the common response to what the camera would show. Requires a matrix that can be
  /// inverted.
  ColourResponse inverse() const { return {-(matrix * black), matrix.inverse()}; }
  friend bool operator==(const ColourResponse&, const ColourResponse&) = default;
};

/// Every pixel corrected, rounded, and kept within 0 to 255. Requires RGB8.
void correct(Image& image, const ColourResponse& response);

}  // namespace v3d
