// Accuracy by visibility: separates errors of the reconstruction from places that too few cameras
// see.
#pragma once

#include <array>
#include <span>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "recon/metrics/evaluation.h"

namespace v3d {

/// Parts of two surfaces, 0 to 1. Places of the reconstruction are classified by the nearest place
/// of the true surface.
struct VisibilityFigures {
  double truth = 0;         ///< part of the true surface
  double truth_within = 0;  ///< of that, the part within the limit of the reconstruction
  double reconstructed = 0;
  double reconstructed_within = 0;
};

/// By the number of cameras that see the true place: none, one, two, three or more.
struct VisibilityReport {
  std::array<VisibilityFigures, 4> seen_by;

  /// The f-score if all places that at least `cameras` cameras see were correct.
  double f_score_if_right_from(size_t cameras) const;
};

/// A camera sees a place that projects into its image, faces it by less than 78 degrees, and is not
/// hidden by the true surface. `limit_m` is the largest correct distance, metres. Points as in
/// compare_surfaces(). All 0 when one of the surfaces has no area.
VisibilityReport compare_by_visibility(const Mesh& reconstructed, const Mesh& truth,
                                       std::span<const CameraModel> cameras, double limit_m,
                                       const SurfaceDistanceOptions& options = {});

}  // namespace v3d
