// How well cameras agree about a small piece of surface: normalised cross-correlation of template
// windows, equations (4) and (5) of the paper, at many depths at once.
#pragma once

#include <array>

#include "recon/visibility/luminance.h"

namespace v3d {

/// Where a camera sees a template window: to first order in the window's two axes and in the way
/// along the normal. Pixels of `image`; (0, 0) is the centre of its first.
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

/// Numbers of steps along the normal: k-th entry stands for first + k.
using DepthProfile = std::array<float, kDepthSteps>;

struct WindowViews {
  int count = 0;
  std::array<WindowView, kMaxWindowViews> view;    ///< the first is the reference camera
  std::array<uint32_t, kMaxWindowViews> camera{};  ///< what views_of() numbers it
};

struct CorrelationOptions {
  int side = 7;        ///< samples along each axis of the window; odd, at most kMaxWindowSide
  float first = -8;    ///< steps along the normal at which a profile begins
  float noise = 1;     ///< variance of a sample that says nothing, squared grey values
  bool robust = true;  ///< cameras that contradict the reference do not count against it
};

/// How well any two cameras agree, where others may look at something else.
struct PairAgreement {
  /// Mean of the correlations of the two pairs that agree best; negative ones count as 0.
  DepthProfile score{};
  /// A bit per view: it correlates with another one by `least` or more.
  std::array<uint8_t, kDepthSteps> agreeing{};
};

/// True when every sample of the window, at every depth, lies in the image.
bool window_fits(const WindowView& view, const CorrelationOptions& options);

/// Mean over the cameras behind the first of their normalised cross-correlation with the first, for
/// kDepthSteps windows along the normal. Requires two views or more, all of them window_fits().
/// Vectorised for the processor it runs on; every processor gives the same bits.
void correlate(const WindowViews& views, const CorrelationOptions& options, DepthProfile& profile);

/// The same for every pair of cameras, without a reference. `robust` says nothing here.
void correlate_pairs(const WindowViews& views, const CorrelationOptions& options, float least,
                     PairAgreement& agreement);

}  // namespace v3d
