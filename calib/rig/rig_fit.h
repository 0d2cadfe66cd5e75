// All cameras of a rig together, from a board that was carried through the studio.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/camera_model.h"
#include "calib/boards/board.h"
#include "calib/lens/lens_fit.h"
#include "calib/rig/pair_poses.h"

namespace v3d::calib {

struct RigOptions {
  /// The cameras as they were calibrated before: their lenses are taken over and stay. Otherwise
  /// the lenses are fitted too.
  std::optional<Rig> before;
  /// A camera that is up to so many instants late or early, or a part of one, is put right, and
  /// RigFit says so; more is refused. One is what buffers of free-running cameras hold back.
  int most_late = 1;
  int most_instants = 400;  ///< of those that two or more cameras share
  int threads = 2;
};

/// A corner in an image, and by how much the finished calibration misses it (seen less projected).
struct CornerResidual {
  Eigen::Vector2d pixel;
  Eigen::Vector2d miss;
};

struct CameraFit {
  double rms_px = 0;
  int views = 0;     ///< pictures of the board that count
  int found = 0;     ///< pictures in which it was found
  int rejected = 0;  ///< left out because they fit nobody else
  double late = 0;   ///< instants by which its pictures came too late, and were put right
  int coefficients = 0;
  double coverage = 0;  ///< part of the image in which corners were seen
  std::vector<CornerResidual> residuals{};
};

/// A picture that was left out, and why.
struct RejectedObservation {
  int camera = 0;
  int64_t instant = 0;
  std::string reason;
};

struct RigFit {
  /// World: z up as the cameras' images have it, origin amid what they look at; a guess until a
  /// board on the floor says better (floor.h).
  Rig rig;
  double rms_px = 0;
  std::vector<CameraFit> cameras;  ///< as in the rig
  std::vector<PairPose> pairs;     ///< all that share an instant
  RigTree tree;
  std::vector<RejectedObservation> rejected;
  std::map<int64_t, RigidTransform> world_from_board;
};

/// "cameras out of sync: cam2 is 1 picture late against the others"; empty where none is.
std::string lateness_text(const std::vector<CameraObservations>& cameras,
                          const std::vector<double>& late);

/// Lenses where they are not known, pairwise poses, spanning tree, one robust bundle adjustment
/// over all observations. No instant needs to be shared by all. Throws InputError that names the
/// cause and what to record: too few boards, a rig that falls apart, cameras out of sync, cameras
/// that are swapped against `before`, a board of another size than then. Pure; uses so many
/// threads.
RigFit fit_rig(const Board& board, const std::vector<CameraObservations>& cameras,
               const RigOptions& options);

}  // namespace v3d::calib
