// The lens of one camera from pictures of a board.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/camera_model.h"
#include "calib/boards/board.h"

namespace v3d::calib {

/// A picture in which the board was found.
struct LensView {
  std::string source;  ///< for people: "left01.jpg", "frame 27"
  BoardSighting sighting;
};

struct LensOptions {
  int most_views = 40;
  /// 4, 5 or 8; 0: cross-validation decides.
  int coefficients = 0;
};

/// How well a lens of so many coefficients foretells pictures it was not fitted to.
struct LensTrial {
  int coefficients = 0;
  double held_out_rms_px = 0;
};

struct FittedView {
  int view = 0;  ///< place in the views given
  double rms_px = 0;
  RigidTransform cam_from_board;
  std::vector<Eigen::Vector2d> misses;  ///< seen less projected, by corner of the sighting
};

struct RejectedView {
  int view = 0;
  std::string reason;
};

struct LensFit {
  CameraModel lens;  ///< at the origin
  int coefficients = 0;
  double rms_px = 0;  ///< over all corners of the fitted views
  std::vector<FittedView> fitted;
  std::vector<RejectedView> rejected;
  int unneeded = 0;  ///< views so like others that they were left out
  std::vector<LensTrial> trials;
  double focal_spread_px = 0;  ///< of fx between fits that each left a fifth of the views out
};

inline constexpr int kFewestLensViews = 5;

/// Chooses views, fits, throws out views that do not fit, chooses the number of coefficients, fits
/// again. Throws InputError, with `camera` in front, where too few views are usable. Pure.
LensFit fit_lens(const std::string& camera, const Board& board, ImageSize size,
                 std::span<const LensView> views, const LensOptions& options);

}  // namespace v3d::calib
