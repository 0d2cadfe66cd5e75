// Photo-consistency of a surface element: normalised cross-correlation of template windows between
// cameras, at 16 depths at once. Source: equations (4) and (5) of the paper.
#pragma once

#include <array>

#include "recon/visibility/luminance.h"

namespace v3d {

/// Projection of a template window into one camera, linearised in the two axes of the window and in
/// the depth along the normal. Pixels of `image`; (0, 0) is the centre of its first pixel.
struct WindowView {
  const Luminance* image = nullptr;
  float u = 0, v = 0;                ///< of the window's centre
  float u_across = 0, v_across = 0;  ///< for one step of the window along its first axis
  float u_down = 0, v_down = 0;      ///< the second axis
  float u_out = 0, v_out = 0;        ///< for one step along the normal
};

inline constexpr int kMaxWindowViews = 8;
inline constexpr int kMaxWindowSide = 11;
inline constexpr int kDepthSteps = 16;

/// Correlation at kDepthSteps depths; entry k is at `first` + k steps along the normal.
using DepthProfile = std::array<float, kDepthSteps>;

struct WindowViews {
  int count = 0;
  std::array<WindowView, kMaxWindowViews> view;    ///< the first is the reference camera
  std::array<uint32_t, kMaxWindowViews> camera{};  ///< index of each camera
};

struct CorrelationOptions {
  int side = 7;        ///< samples along each axis of the window; odd, at most kMaxWindowSide
  float first = -8;    ///< steps along the normal at which a profile begins
  float noise = 1;     ///< variance of image noise, squared grey values
  bool robust = true;  ///< negative correlations count as 0
};

/// Agreement of any two cameras at each depth, without a reference camera.
struct PairAgreement {
  /// Mean of the correlations of the two pairs that agree best; negative ones count as 0.
  DepthProfile score{};
  /// One bit per view: set where it correlates with another view by `min_correlation` or more.
  std::array<uint8_t, kDepthSteps> agreeing{};
};

/// True when every sample of the window, at every depth, lies inside the image.
bool window_fits(const WindowView& view, const CorrelationOptions& options);

/// Mean normalised cross-correlation of each further view with the first, at kDepthSteps depths
/// along the normal.
///
/// Requires at least two views, all of them window_fits(). Vectorised by run-time dispatch; every
/// instruction set gives the same bits.
void correlate(const WindowViews& views, const CorrelationOptions& options, DepthProfile& profile);

/// Correlation of every pair of views, without a reference camera. `min_correlation`: see
/// PairAgreement::agreeing. Requirements as for correlate(); `robust` is ignored.
void correlate_pairs(const WindowViews& views, const CorrelationOptions& options,
                     float min_correlation, PairAgreement& agreement);

}  // namespace v3d
