// Bundle adjustment: lenses, cameras and boards that explain all sightings best. The adapter of the
// Ceres solver.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/camera_model.h"
#include "calib/boards/board.h"

namespace v3d::calib {

/// One corner of one board seen by one camera.
struct BundlePoint {
  int camera = 0;
  int board = 0;  ///< place in Bundle::world_from_board
  int corner = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

/// All unknowns, and what was seen of them. World: any frame; that of the fixed camera stays.
struct Bundle {
  Board board;
  std::vector<CameraModel> cameras;
  std::vector<RigidTransform> world_from_board;
  std::vector<BundlePoint> points;
};

struct BundleOptions {
  /// By camera, how many coefficients of its lens are free, in OpenCV's order: 4, 5 or 8 (with the
  /// camera matrix; skew, thin prism and tilt stay); 0: the lens is known and stays whole. Empty:
  /// all are known.
  std::vector<int> coefficients{};
  /// Cameras whose place stays; at least one, or the world floats.
  std::vector<int> fixed_cameras = {0};
  /// A corner that misses by more than this pulls linearly instead of quadratically (Huber).
  double robust_px = 1.0;
  int iterations = 60;
  int threads = 2;
};

struct BundleSummary {
  bool converged = false;
  int iterations = 0;
  std::string message{};  ///< of the solver, where it did not converge
};

/// Improves `bundle` from where it stands. Levenberg-Marquardt on the reprojection error of every
/// corner, boards eliminated first (Schur complement, sparse). A free lens is also drawn, very
/// weakly, to what lenses are like, so that what no board told stays sane. Requires every camera
/// and board to have points, and first values that put the corners before the cameras. The result
/// depends on the arguments alone, up to rounding by the number of threads.
BundleSummary adjust(Bundle& bundle, const BundleOptions& options);

/// Seen less projected, by point, in pixels; 1e6 for a corner its camera cannot see.
std::vector<Eigen::Vector2d> misses(const Bundle& bundle);

}  // namespace v3d::calib
