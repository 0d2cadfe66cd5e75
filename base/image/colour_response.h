// Colour response of one camera: converts its colours to the common response of the rig.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>

#include "base/image/image.h"

namespace v3d {

/// Affine colour correction in linear light: common = matrix * (camera - black), grey values 0 to
/// 255.
/// The matrix holds the gain, the white balance and the cross-talk of the colour filters. Requires
/// linear images, as machine vision cameras deliver them (gamma off).
struct ColourResponse {
  Eigen::Vector3d black = Eigen::Vector3d::Zero();       ///< grey values of R, G, B without light
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();  ///< camera R, G, B to common R, G, B

  bool is_identity() const { return black.isZero(0) && matrix.isIdentity(0); }
  /// Camera colour to common colour; the result can lie outside 0 to 255.
  Eigen::Vector3d corrected(const Eigen::Vector3d& grey) const { return matrix * (grey - black); }
  /// Converts the common response to that of the camera. Requires an invertible matrix.
  ColourResponse inverse() const { return {-(matrix * black), matrix.inverse()}; }
  friend bool operator==(const ColourResponse&, const ColourResponse&) = default;
};

/// Corrects every pixel in place; rounds and clamps to 0 to 255. Requires RGB8.
void correct(Image& image, const ColourResponse& response);

}  // namespace v3d
