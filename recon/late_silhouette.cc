#include "recon/late_silhouette.h"

#include <cmath>

#include "base/mask_shape.h"

namespace v3d {
namespace {

/// Fewer pixels of what was lost prove nothing: where hull and silhouette touch, some always are.
constexpr int64_t kLeastShown = 60;
/// So many times as large must the part be that is shown of what was lost.
constexpr double kClearly = 2;

}  // namespace

bool ShownChange::is_late() const {
  if (lost_shown < kLeastShown || won - won_shown < kLeastShown) return false;
  return static_cast<double>(lost_shown) * static_cast<double>(won) >
         kClearly * static_cast<double>(won_shown) * static_cast<double>(lost);
}

double ShownChange::excess() const {
  if (lost == 0 || won == 0) return 0;
  const auto a = static_cast<double>(lost);
  const auto b = static_cast<double>(won);
  return (static_cast<double>(lost_shown) / a - static_cast<double>(won_shown) / b) *
         std::sqrt(a * b / (a + b));
}

ShownChange change_shown(const Mask& own, const Mask& expected, const Mask& expected_before) {
  const Mask lost = only_first(expected_before, expected);
  const Mask won = only_first(expected, expected_before);
  return {.lost = lost.count(),
          .lost_shown = both(lost, own).count(),
          .won = won.count(),
          .won_shown = both(won, own).count()};
}

}  // namespace v3d
