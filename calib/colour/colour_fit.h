// Colour calibration of the cameras.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "base/image/colour.h"

namespace v3d::calib {

// Colour calibration: corrections that give all cameras the same colour response.

/// The colour of one place in one camera: mean R, G, B, grey values 0 to 255 in linear light.
/// A camera has at most one sample of a place, except for fit_grey().
struct ColourSample {
  int place = 0;  ///< numbered from 0
  int camera = 0;
  Eigen::Vector3d grey = Eigen::Vector3d::Zero();
};

/// Difference between a camera's colours and the mean of the other cameras at the same places:
/// Delta E (CIE 2000) with grey value 255 as white, median over the places.
struct ColourDifference {
  int places = 0;  ///< shared with another camera
  double before = 0;
  double after = 0;
};

struct ColourFit {
  std::vector<ColourResponse> responses;      ///< by camera
  std::vector<bool> fitted;                   ///< by camera; false: it shares no place
  std::vector<ColourDifference> differences;  ///< by camera
  ColourDifference overall;                   ///< over all cameras and places
  ColourDifference ninety_percent;            ///< 90th percentile over all cameras and places
};

struct ColourOptions {
  std::vector<std::string> cameras;  ///< names
  /// Black level of each camera, measured without light. Empty: black levels are fitted, and their
  /// mean correction over the cameras is 0.
  std::vector<Eigen::Vector3d> black{};
};

inline constexpr int kMinPlaces = 30;

/// Colour responses from places of unknown colour that several cameras observe.
///
/// Solves one linear least-squares problem for all cameras, min |A_c v_pc - X_p|^2, where A_c is
/// the correction of camera c, v_pc its sample of place p, and X_p the unknown colour of the place,
/// which is eliminated. The mean of the A_c is constrained to the identity, so brightness and white
/// of the rig as a whole do not change. Cameras that no shared place connects have a mean for each
/// group; that of a camera without shared places is the identity, and it is not `fitted`. Outliers
/// (highlights, occlusion) are down-weighted by iterated Huber weights. Every fifth place is held
/// out; the differences are those of the held-out places. Throws InputError for fewer than
/// kMinPlaces shared places. Pure.
ColourFit fit_views(std::span<const ColourSample> samples, const ColourOptions& options);

/// Colour responses from a colour chart with 24 patches (places 0 to 23: dark skin to black).
///
/// The corrected colours are the chart's true colours in linear sRGB, with the mean brightness of
/// white over all cameras. Throws InputError with the name of a camera with fewer than 12 patches.
/// Pure.
ColourFit fit_chart(std::span<const ColourSample> samples, const ColourOptions& options);
/// R, G, B of a chart patch, linear light from 0 to 1.
Eigen::Vector3d chart_colour(int patch);

/// White balance and gain from samples of a neutral grey surface, without cross-talk.
///
/// The samples, of any number of images, count as one place: its colour in a camera is their mean.
/// Black levels are those of `options`, or 0. Throws InputError with the name of a camera without
/// samples. Pure.
ColourFit fit_grey(std::span<const ColourSample> samples, const ColourOptions& options);

/// No channel of the grey value (0 to 255) is close to black or to saturation.
bool is_well_exposed(const Eigen::Vector3d& grey);

// Perceptual colour difference (CIEDE2000).

/// CIE L*a*b* of linear R, G, B from 0 to 1, with the primaries and white point of sRGB (D65).
Eigen::Vector3d lab_of(const Eigen::Vector3d& linear_rgb);

/// The CIEDE2000 difference of two colours in L*a*b*. About 1 is just noticeable.
/// Source: Sharma, Wu, Dalal, "The CIEDE2000 Color-Difference Formula", 2005.
double delta_e_2000(const Eigen::Vector3d& lab1, const Eigen::Vector3d& lab2);

}  // namespace v3d::calib
