// v3d-mask-noise: measures the part of a real recording's hull that remains after artificial damage
// to its silhouettes, and the effect of clean-up and silhouette repair.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "base/core/error.h"
#include "base/core/units.h"
#include "base/geometry/box.h"
#include "base/image/mask_morphology.h"
#include "capture/segmentation/mask_cleanup.h"
#include "capture/segmentation/segment_options.h"
#include "daemon/recorded/take_frames.h"
#include "mask_noise/damage.h"
#include "recon/hull/bounds_mask.h"
#include "recon/silhouettes/leave_one_out_hull.h"
#include "v3dctl/options.h"
#include "v3dctl/reconstruct/reconstruct_request.h"
#include "v3dctl/reconstruct/reconstruction_bounds.h"
#include "v3dctl/reconstruct/silhouette_repair.h"

namespace v3d::bench {
namespace {

using Masks = std::vector<Mask>;

/// Volumes as parts of the undamaged hull.
struct Score {
  double kept = 0;   ///< in both hulls
  double added = 0;  ///< only in the damaged hull
};

/// Scores after damage, after clean-up, and after clean-up and repair.
struct Scores {
  Score damaged, cleaned, repaired;
};

struct Arguments {
  std::filesystem::path take;
  std::string bounds, voxel, leave_out;
  int64_t pulse = 0;
  uint32_t first_seed = 101;
  int seeds = 5;
};

/// One pulse of a take.
class Recording {
 public:
  explicit Recording(const Arguments& arguments)
      : take_(arguments.take,
              ctl::cameras_without(load_take_info({arguments.take}),
                                   ctl::parse_names(arguments.leave_out, "--leave-out"))),
        options_(options_of(arguments, take_.rig())),
        hulls_(take_.rig(), options_.bounds, options_.voxel_m, options_.min_views),
        frames_(take_.read(arguments.pulse)) {
    for (size_t c = 0; c < frames_.size(); ++c) {
      if (!frames_[c])
        throw InputError("--pulse: the pulse has no frame of " + take_.rig()[c].name);
      truth_.push_back(
          intersection_of(frames_[c]->mask, bounds_mask(options_.bounds, take_.rig()[c].model)));
    }
    whole_ = hulls_.volume(pointers_to(truth_));
  }

  double volume_m3() const {
    return static_cast<double>(whole_.count()) * std::pow(options_.voxel_m, 3);
  }

  Scores scores_of(const Damage& damage, uint32_t seed) {
    std::mt19937 random(seed);
    Masks masks = truth_;
    for (const size_t c : chosen(damage, random)) damage.apply(masks[c], random);
    Scores scores;
    scores.damaged = score_of(pointers_to(masks));
    for (Mask& mask : masks) MaskCleanup().clean(mask, SegmentOptions());
    scores.cleaned = score_of(pointers_to(masks));
    scores.repaired = repaired(masks);
    return scores;
  }

 private:
  static ReconstructOptions options_of(const Arguments& arguments, const Rig& rig) {
    ReconstructOptions options;
    options.bounds = parse_bounds(arguments.bounds);
    options.voxel_m = parse_length(arguments.voxel);
    options.min_views = ctl::default_min_views(static_cast<int>(rig.size()));
    return options;
  }

  static std::vector<const Mask*> pointers_to(const Masks& masks) {
    std::vector<const Mask*> all;
    for (const Mask& mask : masks) all.push_back(&mask);
    return all;
  }

  /// The cameras whose masks are damaged.
  std::vector<size_t> chosen(const Damage& damage, std::mt19937& random) const {
    std::vector<size_t> cameras(truth_.size());
    std::iota(cameras.begin(), cameras.end(), size_t{0});
    if (damage.everywhere) return cameras;
    std::shuffle(cameras.begin(), cameras.end(), random);
    cameras.resize(std::max<size_t>(1, cameras.size() / 4));
    return cameras;
  }

  /// Score after the repair of v3dctl reconstruct --repair.
  Score repaired(const Masks& masks) {
    ctl::SegmentedFrames frames = frames_;
    for (size_t c = 0; c < frames.size(); ++c) frames[c]->mask = masks[c];
    ctl::SegmentedFrames no_next(frames.size());
    ctl::TakeSilhouetteRepair(take_.rig(), options_).repair(0, frames, no_next);
    std::vector<const Mask*> all;
    for (const auto& frame : frames) all.push_back(frame ? &frame->mask : nullptr);
    return score_of(all);
  }

  Score score_of(std::span<const Mask* const> masks) {
    const SparseVolume& hull = hulls_.volume(masks);
    const int64_t common = count_common(hull, whole_);
    const auto whole = static_cast<double>(whole_.count());
    return {static_cast<double>(common) / whole,
            static_cast<double>(hull.count() - common) / whole};
  }

  TakeFrames take_;
  const ReconstructOptions options_;
  LeaveOneOutHull hulls_;
  ctl::SegmentedFrames frames_;
  Masks truth_;
  SparseVolume whole_;
};

/// Prints means over all seeds, and the minimum of the kept part after repair.
void print(const Damage& damage, const std::vector<Scores>& all) {
  Scores mean;
  double minimum = 1;
  for (const Scores& one : all) {
    const double part = 100.0 / static_cast<double>(all.size());
    const auto add = [part](Score& sum, const Score& score) {
      sum.kept += part * score.kept;
      sum.added += part * score.added;
    };
    add(mean.damaged, one.damaged);
    add(mean.cleaned, one.cleaned);
    add(mean.repaired, one.repaired);
    minimum = std::min(minimum, one.repaired.kept);
  }
  std::printf("%-42s %6.1f +%-5.1f %6.1f +%-5.1f %6.1f +%-5.1f %6.1f\n", damage.name,
              mean.damaged.kept, mean.damaged.added, mean.cleaned.kept, mean.cleaned.added,
              mean.repaired.kept, mean.repaired.added, 100 * minimum);
  std::fflush(stdout);
}

void try_all(const Arguments& arguments) {
  Recording recording(arguments);
  std::printf("hull of the undamaged silhouettes: %.4g m3\n", recording.volume_m3());
  std::printf("%-42s %13s %13s %13s %6s\n", "kept and added, % of it", "damaged", "cleaned",
              "repaired", "min");
  for (const Damage& damage : all_damages()) {
    std::vector<Scores> scores;
    for (int n = 0; n < arguments.seeds; ++n) {
      scores.push_back(
          recording.scores_of(damage, arguments.first_seed + static_cast<uint32_t>(n)));
    }
    print(damage, scores);
  }
}

}  // namespace
}  // namespace v3d::bench

int main(int argc, char** argv) {
  v3d::bench::Arguments arguments;
  CLI::App app{
      "Damages the silhouettes of one pulse of a take and prints how much of the hull remains: "
      "without repair, after the segmenter's clean-up, and after v3dctl reconstruct --repair."};
  app.add_option("TAKE", arguments.take)->required();
  app.add_option("--bounds", arguments.bounds, "X0,Y0,Z0,X1,Y1,Z1, metres")->required();
  app.add_option("--voxel", arguments.voxel, "Edge of a voxel, such as 8mm")->required();
  app.add_option("--leave-out", arguments.leave_out, "CAM,...");
  app.add_option("--pulse", arguments.pulse)->capture_default_str();
  app.add_option("--first-seed", arguments.first_seed)->capture_default_str();
  app.add_option("--seeds", arguments.seeds)->capture_default_str()->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  try {
    v3d::bench::try_all(arguments);
  } catch (const v3d::InputError& error) {
    std::fprintf(stderr, "v3d-mask-noise: %s\n", error.what());
    return 2;
  }
  return 0;
}
