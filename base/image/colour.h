// Colours of raw samples: colour response of a camera, demosaicing.
#pragma once

#include <Eigen/Core>

#include "base/image/image.h"

namespace v3d {

// Colour response of one camera: converts its colours to the common response of the rig.

/// Affine colour correction in linear light: common = matrix * (camera - black), grey values 0 to
/// 255.
/// The matrix holds the gain, the white balance and the cross-talk of the colour filters. Requires
/// linear images, as machine vision cameras deliver them (gamma off).
struct ColourResponse {
  Eigen::Vector3d black = Eigen::Vector3d::Zero();       ///< grey values of R, G, B without light
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();  ///< camera R, G, B to common R, G, B

  bool is_identity() const;
  /// Camera colour to common colour; the result can lie outside 0 to 255.
  Eigen::Vector3d corrected(const Eigen::Vector3d& grey) const;
  /// Converts the common response to that of the camera. Requires an invertible matrix.
  ColourResponse inverse() const;
  friend bool operator==(const ColourResponse& a, const ColourResponse& b);
};

/// Corrects every pixel in place; rounds and clamps to 0 to 255. Requires RGB8.
void correct(Image& image, const ColourResponse& response);

// Demosaicing: converts raw sensor images to RGB, and RGB to a Bayer mosaic.

/// Converts an image of any format to RGB8.
/// Grey is copied to three channels. A Bayer image is demosaiced with linear filters of 5 x 5
/// pixels: measured samples stay unchanged, and the other two colours follow their detail. The
/// image is mirrored at its borders.
/// Pure function; runs in one thread.
/// Source: Malvar, He and Cutler, High-quality linear interpolation for demosaicing of
/// Bayer-patterned color images, ICASSP 2004.
Image to_rgb(ImageView source);

/// The image of a sensor with the colour filters of `format`: one of the three samples of each
/// pixel. Requires RGB8 and is_bayer(format).
Image mosaic(ImageView rgb, PixelFormat format);

}  // namespace v3d
