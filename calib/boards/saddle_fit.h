// Corners of chessboards as saddle points of the grey values.
#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <vector>

namespace v3d::calib {

/// Shares of the spacing of the corners. More averages noise better, but other edges must be
/// farther away.
struct SaddleFit {
  float
      smoothing;  ///< deviation of the Gaussian that smoothes the grey values; 0.7 pixels at least
  float weights;  ///< deviation of the weights of pixels around a point; 1 pixel at least
};
/// For chessboards, and for boards with markers in their squares.
inline constexpr SaddleFit kChessSaddles{.smoothing = 0.1F, .weights = 0.1F};
inline constexpr SaddleFit kCharucoSaddles{.smoothing = 0.03F, .weights = 0.05F};

/// Moves each point to the saddle of the smoothed grey values near it. A quadratic function is
/// fitted to the pixels around the point, with Gaussian weights, and the point moves to where its
/// gradient is zero, until it rests. A point stays where the function is no
/// saddle, and where it would move by more than a seventh of the spacing.
///
/// `grey`: one channel of 8 bits. `points`: pixels in the image, as of cv::cornerSubPix.
/// `spacings`: distance, pixels, from each point to the nearest other corner; 0: the point stays.
/// Any thread.
///
/// Source: Lucchese and Mitra, "Using saddle points for subpixel feature detection in camera
/// calibration targets", APCCAS 2002; settings: docs/calibration.md.
void refine_saddles(const cv::Mat& grey, std::span<const float> spacings, const SaddleFit& fit,
                    std::vector<cv::Point2f>& points);

}  // namespace v3d::calib
