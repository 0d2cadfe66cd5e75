// The places of calibrated cameras, improved without a board: from the silhouettes of a take.
#pragma once

#include <vector>

#include "base/camera_model.h"
#include "base/mask.h"

namespace v3d::calib {

/// The silhouettes of all cameras at one instant; null where a camera has none.
using SilhouetteSet = std::vector<const Mask*>;

struct RefineOptions {
  bool focal_lengths = false;  ///< are fitted too
  /// How far the cameras are thought to be off, pixels: what silhouettes do not tell stays.
  double expected_px = 3;
  int threads = 2;
};

/// What a camera's outlines say, before and after.
struct RefinedCamera {
  int tangents = 0;  ///< that were compared, in the instants that are held out
  /// By how much the planes that touch its silhouettes and another camera's disagree, pixels,
  /// median.
  double before_px = 0;
  double after_px = 0;
  double moved_px = 0;  ///< by how much its image of the scene shifted
};

struct RefineResult {
  Rig rig;  ///< as it was, where the silhouettes do not prove that the new one is better
  bool better = false;
  double before_px = 0;  ///< over all cameras
  double after_px = 0;
  std::vector<RefinedCamera> cameras;
};

/// Instants in which the performer stands or reaches elsewhere tell most; every third is held out
/// of the fit and is the judge of it: only where the planes' disagreement falls by two fifths is
/// the rig changed. Silhouettes cut by an image's border count where they are whole. Position, turn
/// and scale of the rig as a whole no silhouette tells: they stay. Throws InputError for fewer than
/// kFewestSets instants, and where hardly any planes touch two cameras' silhouettes. Pure; uses so
/// many threads.
RefineResult refine_by_silhouettes(const Rig& rig, const std::vector<SilhouetteSet>& sets,
                                   const RefineOptions& options);
inline constexpr int kFewestSets = 6;

}  // namespace v3d::calib
