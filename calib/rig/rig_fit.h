// Rig calibration from its initial rig.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/rigid_transform.h"
#include "calib/boards/board.h"
#include "calib/rig/pair_poses.h"

namespace v3d::calib {

// Rig calibration: lenses and poses of all cameras, from a board that is carried through the
// studio.

struct RigOptions {
  /// The previous calibration. Where it is given, its lenses and colour responses are used without
  /// change; otherwise the lenses are fitted, too, and the colour responses are the identity.
  std::optional<Rig> previous;
  /// Time offsets up to this many instants are corrected and reported; larger ones are an error.
  /// The buffers of free-running cameras can delay images by one instant.
  int max_time_offset = 1;
  /// What to do about a larger one, for the message; it depends on the source of the images.
  std::string time_offset_remedy{};
  int max_instants = 400;  ///< of those that at least two cameras share
  int threads = 2;
};

/// An observed corner and its reprojection residual (observed minus projected), pixels.
struct CornerResidual {
  Eigen::Vector2d pixel;
  Eigen::Vector2d residual;
};

struct CameraFit {
  double rms_px = 0;
  int views = 0;           ///< observations that are used
  int found = 0;           ///< images in which the board was found
  int rejected = 0;        ///< observations that disagree with those of the other cameras
  double time_offset = 0;  ///< corrected offset, instants; positive: the images are late
  int coefficients = 0;    ///< fitted distortion coefficients; 0: the lens is known
  double coverage = 0;     ///< share of the image with observed corners, 0 to 1
  /// Of the lens alone, as in LensFit::focal_deviation(); 0: the lens is known.
  double focal_deviation = 0;
  std::vector<CornerResidual> residuals{};
};

/// A rejected observation and the reason.
struct RejectedObservation {
  int camera = 0;
  int64_t instant = 0;
  std::string reason;
};

struct RigFit {
  /// World frame: metres, z along the mean upward direction of the images, origin at the point
  /// nearest to all optical axes. rig/rig_alignment.h determines the final world frame.
  Rig rig;
  double rms_px = 0;
  std::vector<CameraFit> cameras;  ///< in the order of the rig
  std::vector<PairPose> pairs;     ///< all that share an instant
  RigTree tree;
  std::vector<RejectedObservation> rejected;
  std::map<int64_t, RigidTransform> world_from_board;  ///< by instant
};

/// A message about time offsets (instants, by camera): "cameras out of sync: cam2 is 1 image late
/// relative to the others"; empty where there are none.
std::string time_offset_text(const std::vector<CameraObservations>& cameras,
                             const std::vector<double>& offsets);

/// Calibrates a rig of two or more cameras.
///
/// Steps: unknown lenses, relative poses of pairs, spanning tree, and one robust bundle adjustment
/// of all observations. No instant needs to be shared by all cameras.
/// Throws InputError with the cause and what to record: too few boards, disconnected cameras, large
/// time offsets, cameras that are swapped relative to the previous calibration, another board size.
/// Pure. Uses options.threads threads.
RigFit fit_rig(const Board& board, const std::vector<CameraObservations>& cameras,
               const RigOptions& options);

// An initial rig for a studio that is not calibrated yet.

/// Assumed camera poses and lenses, sufficient to record a take of boards.
///
/// The cameras have no distortion. They stand at equal distances on a level ring around `space`
/// (world frame, metres, z up), in the order of `names`. They look at its centre from where the
/// whole of it is in their images. `horizontal_fov_deg`: above 0 and below 180.
/// Requires is_image_size(size). Pure.
Rig initial_rig(const std::vector<std::string>& names, ImageSize size, double horizontal_fov_deg,
                const Box& space);

}  // namespace v3d::calib
