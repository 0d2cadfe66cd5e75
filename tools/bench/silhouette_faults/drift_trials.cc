#include "silhouette_faults/drift_trials.h"

#include <algorithm>
#include <cstdio>

#include "recon/silhouettes/displaced_camera.h"
#include "recon/silhouettes/leave_one_out_hull.h"
#include "sim/rendering/scene.h"
#include "workload.h"

namespace v3d::bench {
namespace {

constexpr int kPulses = 6;
constexpr double kVoxel = 0.012;
constexpr int kKnockPx = 3;

struct Aside {
  int camera = -1;  ///< camera with shifted silhouettes; -1: none
  int right = 0;
  int down = 0;
};

Mask moved(const Mask& mask, const Aside& aside) {
  Mask result(mask.size());
  const ImageSize size = mask.size();
  for (int y = std::max(0, aside.down); y < std::min(size.height, size.height + aside.down); ++y) {
    for (int x = std::max(0, aside.right); x < std::min(size.width, size.width + aside.right);
         ++x) {
      if (mask.get(x - aside.right, y - aside.down)) result.set(x, y);
    }
  }
  return result;
}

std::vector<CameraDisplacement> drift_in(uint64_t seed, const Aside& aside) {
  const Rig cameras = sim::make_rig(kCameras, kSize, seed);
  LeaveOneOutHull hulls(cameras, space(), kVoxel, kMinViews);
  DisplacementMeter meter(cameras);
  for (int pulse = 0; pulse < kPulses; ++pulse) {
    std::vector<Mask> masks;
    for (const RigCamera& camera : cameras) {
      masks.push_back(sim::true_silhouette(camera, 0.1 + 0.2 * pulse, seed));
    }
    if (aside.camera >= 0) masks[aside.camera] = moved(masks[aside.camera], aside);
    const auto all = pointers_to(masks);
    meter.add(all, hulls.silhouettes_of_each(all));
  }
  return meter.result(hulls);
}

void print(uint64_t seed, const Aside& aside, const std::vector<CameraDisplacement>& cameras) {
  std::printf("seed %llu:", static_cast<unsigned long long>(seed));
  for (size_t c = 0; c < cameras.size(); ++c) {
    const bool is_aside = static_cast<int>(c) == aside.camera;
    std::printf(" %s%.2f%s", is_aside ? "aside:" : "", cameras[c].shift.norm(),
                cameras[c].displaced ? "!" : "");
  }
  std::printf("\n");
}

void try_clean(uint64_t seed, bool list, DriftScore& score) {
  const auto cameras = drift_in(seed, {});
  if (list) print(seed, {}, cameras);
  ++score.clean_studios;
  for (const CameraDisplacement& camera : cameras) {
    score.false_alarms += camera.displaced;
    score.largest_clean_px = std::max(score.largest_clean_px, camera.shift.norm());
  }
}

void try_displaced(uint64_t seed, const Aside& aside, bool list, DriftScore& score) {
  const auto cameras = drift_in(seed, aside);
  if (list) print(seed, aside, cameras);
  for (size_t c = 0; c < cameras.size(); ++c) {
    int& count = static_cast<int>(c) == aside.camera ? score.named : score.others_named;
    count += cameras[c].displaced;
  }
  const double px = cameras[aside.camera].shift.norm();
  score.min_px = score.displaced_studios == 0 ? px : std::min(score.min_px, px);
  score.max_px = std::max(score.max_px, px);
  ++score.displaced_studios;
}

}  // namespace

DriftScore try_drift(const DriftTrialOptions& options) {
  static constexpr Aside kWays[] = {
      {0, kKnockPx, 0}, {0, 0, kKnockPx}, {0, -kKnockPx, 0}, {0, 0, -kKnockPx}};
  DriftScore score;
  for (int n = 0; n < options.clean; ++n) {
    try_clean(options.first_seed + static_cast<uint64_t>(n), options.list, score);
  }
  for (int n = 0; n < options.displaced; ++n) {
    Aside aside = kWays[static_cast<size_t>(n) % std::size(kWays)];
    aside.camera = n % kCameras;
    try_displaced(options.first_seed + static_cast<uint64_t>(n), aside, options.list, score);
  }
  return score;
}

}  // namespace v3d::bench
