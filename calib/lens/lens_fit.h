// Lens calibration: camera matrix and distortion of a camera from images of a board.
#pragma once

#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/geometry/camera_model.h"
#include "calib/boards/board.h"

namespace v3d::calib {

/// One image in which the board was found.
struct LensView {
  std::string source;  ///< for messages: "left01.jpg", "frame 27"
  BoardObservation observation;
};

struct LensOptions {
  int max_views = 40;
  /// Number of distortion coefficients: 4, 5 or 8; 0: chosen by cross-validation.
  int coefficients = 0;
};

/// The prediction error of a lens model, by cross-validation.
struct LensTrial {
  int coefficients = 0;
  double held_out_rms_px = 0;
};

struct FittedView {
  int view = 0;  ///< index into the views given to fit_lens()
  double rms_px = 0;
  RigidTransform cam_from_board;
  std::vector<Eigen::Vector2d> residuals;  ///< observed minus projected, by corner
};

struct RejectedView {
  int view = 0;
  std::string reason;
};

struct LensFit {
  CameraModel lens;  ///< with its camera at the origin
  int coefficients = 0;
  double rms_px = 0;  ///< over all corners of the fitted views
  std::vector<FittedView> fitted;
  std::vector<RejectedView> rejected;
  int unneeded = 0;  ///< views that view selection left out
  std::vector<LensTrial> trials;
  /// Standard deviation (1 sigma) of fx: focal_deviation_px().
  double focal_deviation_px = 0;

  /// The deviation as a share of fx.
  double focal_deviation() const { return focal_deviation_px / std::abs(lens.matrix()(0, 0)); }
};

inline constexpr int kMinLensViews = 5;

/// Calibrates one lens.
///
/// Selects views, fits, rejects outlier views, selects the number of coefficients by
/// cross-validation, and fits again. `size` is the size of all images; `camera` is for messages.
/// Throws InputError where fewer than kMinLensViews views are usable, and where they do not
/// determine the focal length, as boards parallel to the image. Pure.
LensFit fit_lens(const std::string& camera, const Board& board, ImageSize size,
                 std::span<const LensView> views, const LensOptions& options);

/// A sentence for a focal length that boards determine poorly, with what to record; empty for a
/// better one. `focal_deviation`: a share of the focal length.
std::string focal_weakness(const std::string& camera, double focal_deviation);

/// One sentence for each weakness of a lens: a large residual, a poorly determined focal length.
std::vector<std::string> find_weaknesses(const std::string& camera, const LensFit& fit);

/// The lenses of all cameras of a rig.
struct RigLenses {
  std::vector<CameraModel> lenses;       ///< with their cameras at the origin
  std::vector<int> coefficients;         ///< number of fitted coefficients; 0: the lens is known
  std::vector<double> focal_deviations;  ///< LensFit::focal_deviation(); 0: the lens is known
};

/// The lens of each camera: from `previous` where that is given, else by fit_lens().
///
/// Throws InputError where fit_lens() throws it for a camera, where `previous` lacks it or has
/// another image size, and where the images of two cameras fit each other's lens. Uses `threads`
/// threads.
RigLenses fit_rig_lenses(const Board& board, const std::vector<CameraObservations>& cameras,
                         const std::optional<Rig>& previous, int threads);

/// Throws InputError: "swapped cameras: A and B: EVIDENCE the other: ...".
[[noreturn]] void throw_swapped_cameras(const std::string& a, const std::string& b,
                                        const std::string& evidence);

}  // namespace v3d::calib
