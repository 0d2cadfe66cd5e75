#include "silhouette_faults/drift_trials.h"

#include <algorithm>

#include "recon/drift.h"
#include "recon/hull_of_others.h"
#include "sim/scene.h"
#include "workload.h"

namespace v3d::bench {
namespace {

constexpr int kPulses = 6;
constexpr double kVoxel = 0.012;
constexpr int kKnockPx = 3;

Mask aside(const Mask& mask) {
  Mask result(mask.size());
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = kKnockPx; x < mask.size().width; ++x) {
      if (mask.get(x - kKnockPx, y)) result.set(x, y);
    }
  }
  return result;
}

/// `knocked`: the camera whose silhouettes lie aside, -1 for none.
std::vector<CameraDrift> drift_in(uint64_t seed, int knocked) {
  const Rig cameras = sim::make_rig(kCameras, kSize, seed);
  HullOfOthers hulls(cameras, space(), kVoxel, kMinViews);
  DriftMeter meter(cameras);
  for (int pulse = 0; pulse < kPulses; ++pulse) {
    std::vector<Mask> masks;
    for (const RigCamera& camera : cameras) {
      masks.push_back(sim::true_silhouette(camera, 0.1 + 0.2 * pulse, seed));
    }
    if (knocked >= 0) masks[knocked] = aside(masks[knocked]);
    const auto all = pointers_to(masks);
    meter.add(all, hulls.silhouettes_of_each(all));
  }
  return meter.result();
}

}  // namespace

DriftScore try_drift(int studios) {
  DriftScore score;
  for (int n = 0; n < studios; ++n) {
    const auto seed = uint64_t{1} + static_cast<uint64_t>(n);
    ++score.clean_studios;
    for (const CameraDrift& camera : drift_in(seed, -1)) {
      score.false_alarms += camera.knocked;
      score.largest_clean_px = std::max(score.largest_clean_px, camera.shift.norm());
    }
    const int knocked = n % kCameras;
    const CameraDrift found = drift_in(seed, knocked)[knocked];
    ++score.knocked_studios;
    score.named += found.knocked;
    const double px = found.shift.norm();
    score.least_px = n == 0 ? px : std::min(score.least_px, px);
    score.most_px = std::max(score.most_px, px);
  }
  return score;
}

}  // namespace v3d::bench
