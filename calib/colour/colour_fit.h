// Cameras brought to one colour response.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/colour_response.h"

namespace v3d::calib {

/// What a camera shows of a place that others show too, mean grey values 0 to 255 of linear light.
/// Places are numbered from 0.
struct ColourSample {
  int place = 0;
  int camera = 0;
  Eigen::Vector3d grey = Eigen::Vector3d::Zero();
};

/// How far a camera's colours are from the mean of the others' at the same places: Delta E (CIE
/// 2000), grey value 255 taken for white; medians over the places.
struct ColourDifference {
  int places = 0;  ///< that it shares with another camera
  double before = 0;
  double after = 0;
};

struct ColourFit {
  std::vector<ColourResponse> responses;      ///< by camera
  std::vector<ColourDifference> differences;  ///< by camera
  ColourDifference overall;                   ///< over all cameras and places
  ColourDifference ninety_percent;            ///< the same, of which nine tenths are below
};

/// What is known of the cameras beforehand.
struct ColourOptions {
  std::vector<std::string> cameras;  ///< their names
  /// Their black levels, from pictures without light; empty: they are fitted, so that on the mean
  /// over the cameras nothing changes.
  std::vector<Eigen::Vector3d> black{};
};

/// From places that several cameras show and nobody else knows. The mean over the cameras of all
/// corrections is none, so the brightness and the white of the rig as a whole stay. Places of which
/// a camera disagrees (a highlight, something that hides it) count little. Every fifth place is
/// kept out of the fit, and the differences are those of these. Throws InputError for fewer than
/// kFewestPlaces shared places. Pure.
///
/// Solves for all cameras at once the linear least-squares problem min |A_c v_pc - X_p|^2, X_p the
/// places' unknown colours, which are eliminated, under the constraint that the mean of the A_c is
/// the identity; Huber's weights by iteration.
ColourFit fit_views(std::span<const ColourSample> samples, const ColourOptions& options);
inline constexpr int kFewestPlaces = 30;

/// From a colour chart with 24 patches (place 0 to 23: dark skin to black), of which each camera
/// shows most. The result is the chart's true colour in linear sRGB; the white of the chart is as
/// bright as it was on the mean over the cameras. Throws InputError that names a camera with fewer
/// than 12 patches. Pure.
ColourFit fit_chart(std::span<const ColourSample> samples, const ColourOptions& options);
/// R, G, B of a patch, linear light from 0 to 1.
Eigen::Vector3d chart_colour(int patch);

/// From a neutral grey surface (all places are of it): white balance and gain, no cross-talk. Black
/// levels are what `options` says, or 0. Throws InputError that names a camera without it. Pure.
ColourFit fit_grey(std::span<const ColourSample> samples, const ColourOptions& options);

/// A mean grey value that the camera can tell apart from less and from more.
bool is_well_exposed(const Eigen::Vector3d& grey);

}  // namespace v3d::calib
