#include "recon/silhouettes/frame_lag.h"

#include <algorithm>
#include <cmath>

#include "base/mask_shape.h"

namespace v3d {
namespace {

/// Fewer pixels of what was lost prove nothing: where hull and silhouette touch, some always are.
/// Of an image of XGA; of a larger one they are as many more as it has pixels.
constexpr int64_t kMinShown = 60;
constexpr int64_t kXgaPixels = 1024 * 768;
/// So many times as large must the part be that is shown of what was lost.
constexpr double kClearly = 2;
/// And by so many standard deviations, as of an image of XGA. With few cameras hulls err more:
/// clean silhouettes of 8 came to 1.8. Of 15 as many late ones are found as without it
/// (v3d-silhouette-faults, seeds 1 and 7).
constexpr double kMinExcess = 2.3;

}  // namespace

bool SilhouetteChange::is_late() const {
  const double larger =
      static_cast<double>(std::max(kXgaPixels, pixels)) / static_cast<double>(kXgaPixels);
  const double least = kMinShown * larger;
  if (static_cast<double>(lost_shown) < least) return false;
  if (static_cast<double>(gained - gained_shown) < least) return false;
  // Neighbouring pixels are one observation where the image is larger.
  if (excess() < kMinExcess * std::sqrt(larger)) return false;
  return static_cast<double>(lost_shown) * static_cast<double>(gained) >
         kClearly * static_cast<double>(gained_shown) * static_cast<double>(lost);
}

double SilhouetteChange::excess() const {
  if (lost == 0 || gained == 0) return 0;
  const auto a = static_cast<double>(lost);
  const auto b = static_cast<double>(gained);
  return (static_cast<double>(lost_shown) / a - static_cast<double>(gained_shown) / b) *
         std::sqrt(a * b / (a + b));
}

SilhouetteChange silhouette_change(const Mask& own, const Mask& expected,
                                   const Mask& expected_before) {
  const Mask lost = only_first(expected_before, expected);
  const Mask gained = only_first(expected, expected_before);
  return {.pixels = int64_t{own.size().width} * own.size().height,
          .lost = lost.count(),
          .lost_shown = both(lost, own).count(),
          .gained = gained.count(),
          .gained_shown = both(gained, own).count()};
}

}  // namespace v3d
