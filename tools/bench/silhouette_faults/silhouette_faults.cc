// v3d-silhouette-faults: measures the detection of faulty silhouettes and displaced cameras, and
// the effect of silhouette repair, in simulated studios.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <string>

#include "cli/command.h"
#include "recon/silhouettes/displaced_camera.h"
#include "recon/silhouettes/leave_one_out_hull.h"
#include "silhouette_faults/fault_trials.h"
#include "sim/rendering/scene.h"
#include "workload.h"

namespace v3d::bench {

// Trials of the detection of displaced cameras in simulated studios.

struct DriftScore {
  int clean_studios = 0;
  int false_alarms = 0;
  double largest_clean_px = 0;  ///< largest detected shift without a displaced camera, pixels
  int displaced_studios = 0;
  int named = 0;                  ///< studios whose displaced camera was named
  int others_named = 0;           ///< wrongly named cameras
  double min_px = 0, max_px = 0;  ///< detected shift of the displaced cameras
};

struct DriftTrialOptions {
  uint64_t first_seed = 1;  ///< seed of the first studio; others follow
  int clean = 24;
  int displaced = 24;
  bool list = false;  ///< prints every studio
};

/// Runs the trials: rigs of 15 XGA cameras with different seeds and six pulses each. `clean`
/// studios match their calibration. In `displaced` studios, the silhouettes of one camera are
/// shifted by 3 pixels: right, down, left or up.
DriftScore try_drift(const DriftTrialOptions& options);

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

std::vector<recon::CameraDisplacement> drift_in(uint64_t seed, const Aside& aside) {
  const Rig cameras = sim::make_rig(kCameras, kSize, seed);
  recon::LeaveOneOutHull hulls(cameras, space(), kVoxel, kMinViews);
  recon::DisplacementMeter meter(cameras);
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

void print(uint64_t seed, const Aside& aside,
           const std::vector<recon::CameraDisplacement>& cameras) {
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
  for (const recon::CameraDisplacement& camera : cameras) {
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

namespace {

using namespace v3d::bench;

void print(const std::vector<FaultScore>& scores) {
  std::printf("%-16s %7s %7s %10s %13s %14s %14s\n", "fault", "trials", "found", "innocent",
              "false alarms", "voxels wrong", "when repaired");
  for (const FaultScore& score : scores) {
    std::printf("%-16s %7d %7d %10lld %13lld %14lld %14lld\n", score.kind.c_str(), score.trials,
                score.found, static_cast<long long>(score.innocent),
                static_cast<long long>(score.false_alarms),
                static_cast<long long>(score.wrong_before),
                static_cast<long long>(score.wrong_after));
  }
}

void print(const DriftScore& drift) {
  std::printf("%d studios as calibrated: %d false alarms, largest shift %.2f px\n",
              drift.clean_studios, drift.false_alarms, drift.largest_clean_px);
  std::printf(
      "%d with a camera displaced by 3 px: %d named, %d with another named; shift %.2f to %.2f "
      "px\n",
      drift.displaced_studios, drift.named, drift.others_named, drift.min_px, drift.max_px);
}

}  // namespace

int main(int argc, char** argv) {
  FaultTrialOptions faults;
  DriftTrialOptions drift;
  uint64_t first_seed = 1;
  v3d::cli::Program app{
      "Adds faults to the silhouettes of the simulated performer, displaces cameras, and counts "
      "detected and repaired faults."};
  app.add_option("--first-seed", first_seed, "Seed of the first studio; others follow (1)");
  app.add_option("--studios", faults.studios, "Studios with faults in the silhouettes (1)")
      .check(v3d::cli::integer_in(0, 10'000));
  app.add_option("--pulses", faults.pulses, "Instants in each of these studios (8)")
      .check(v3d::cli::integer_in(1, 10'000));
  app.add_option("--displaced", drift.displaced, "Studios with a displaced camera (24)")
      .check(v3d::cli::integer_in(0, 10'000));
  app.add_option("--clean", drift.clean, "Studios without a displaced camera (24)")
      .check(v3d::cli::integer_in(0, 10'000));
  app.add_flag("--list", faults.list, "Print every trial");
  if (const auto status = app.parse_or_report(argc, argv)) return *status;
  faults.first_seed = drift.first_seed = first_seed;
  drift.list = faults.list;
  if (faults.studios > 0) print(try_faults(faults));
  if (drift.displaced + drift.clean > 0) print(try_drift(drift));
  return 0;
}
