// How many cameras see a place on a surface: what a reconstruction can know of it.
#pragma once

#include <array>
#include <span>

#include "base/camera_model.h"
#include "base/mesh.h"
#include "recon/metrics/evaluation.h"

namespace v3d {

/// Parts of two surfaces; of the reconstruction, by what can be seen of the nearest true place.
struct VisibilityFigures {
  double truth = 0;         ///< part of the true surface
  double truth_within = 0;  ///< of that, what lies within the limit of the reconstruction
  double reconstructed = 0;
  double reconstructed_within = 0;
};

/// By the number of cameras that see the true place: none, one, two, three or more.
struct VisibilityReport {
  std::array<VisibilityFigures, 4> seen_by;

  /// The f-score if all that at least `cameras` see were right, and the rest stayed as it is.
  double f_score_if_right_from(size_t cameras) const;
};

/// A camera sees a place in its image that faces it by less than 78 degrees off the normal and that
/// nothing of the true surface hides. Points are chosen as by compare_surfaces(). All 0 where one
/// of the surfaces has no area.
VisibilityReport compare_by_visibility(const Mesh& reconstructed, const Mesh& truth,
                                       std::span<const CameraModel> cameras, double limit_m,
                                       const SurfaceDistanceOptions& options = {});

}  // namespace v3d
