// Silhouettes that show the pulse before: found by what changed from one pulse to the next.
#pragma once

#include <cstdint>

#include "base/mask.h"

namespace v3d {

/// What the hull of the others lost and won from the pulse before to this one, and how much of
/// either a camera's silhouette shows; pixels.
struct SilhouetteChange {
  int64_t pixels = 0;  ///< of the image
  int64_t lost = 0;
  int64_t lost_shown = 0;
  int64_t gained = 0;
  int64_t gained_shown = 0;

  /// The silhouette shows what is no longer there, and not what has come. A camera in step shows
  /// nothing of what was lost, for its silhouette lies inside the hull, and much of what was won;
  /// one that is a pulse late, the reverse. False where too little moved to tell.
  bool is_late() const;
  /// By how much the part that is shown of what was lost exceeds that of what was won, in standard
  /// deviations of independent pixels: to compare cameras.
  double excess() const;
};

/// `expected`, `expected_before`: the silhouette of the hull of the others in this camera, at this
/// pulse and at the one before. Requires equal sizes. Pure.
SilhouetteChange silhouette_change(const Mask& own, const Mask& expected,
                                   const Mask& expected_before);

}  // namespace v3d
