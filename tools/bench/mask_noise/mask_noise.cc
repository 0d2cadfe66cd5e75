// v3d-mask-noise: measures the part of a real recording's hull that remains after artificial damage
// to its silhouettes, and the effect of clean-up and silhouette repair.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <random>
#include <span>

#include "base/core/error.h"
#include "base/core/text.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/mask.h"
#include "base/image/mask_operations.h"
#include "capture/segmentation/background.h"
#include "capture/segmentation/mask_cleanup.h"
#include "cli/command.h"
#include "daemon/recorded/take_frames.h"
#include "recon/hull/voxel_grid.h"
#include "recon/silhouettes/leave_one_out_hull.h"
#include "v3dctl/options.h"
#include "v3dctl/reconstruct/reconstruct_request.h"
#include "v3dctl/reconstruct/take_surfaces.h"

namespace v3d::bench {

// Kinds of artificial damage to silhouettes.

/// One kind of damage. `apply` changes a mask; the result depends only on the mask and `random`.
struct Damage {
  const char* name;
  /// True: the masks of all cameras are damaged. False: of one camera in four, at least one.
  bool everywhere;
  void (*apply)(Mask& mask, std::mt19937& random);
};

/// All kinds: first small noise of a bad segmentation, then large faults of people and equipment.
std::span<const Damage> all_damages();

namespace {

constexpr double kSalt = 0.05;     // part of all pixels that are inverted
constexpr double kFrayed = 0.5;    // part of the outline's pixels that are lost
constexpr int kHoles = 12;         // small holes in each silhouette
constexpr int kMaxHoleRadius = 4;  // pixels

int below(std::mt19937& random, int count) {
  return static_cast<int>(random() % static_cast<uint32_t>(count));
}
bool happens(std::mt19937& random, double part) {
  return static_cast<double>(random()) < part * 4294967296.0;
}

template <class Change>
void for_every_pixel(const Mask& mask, Change change) {
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) change(x, y);
  }
}

void cut_disc(Mask& mask, int u, int v, int radius) {
  for (int y = std::max(0, v - radius); y <= std::min(mask.size().height - 1, v + radius); ++y) {
    for (int x = std::max(0, u - radius); x <= std::min(mask.size().width - 1, u + radius); ++x) {
      if ((x - u) * (x - u) + (y - v) * (y - v) <= radius * radius) mask.set(x, y, false);
    }
  }
}

void leave_alone(Mask&, std::mt19937&) {}

void salt(Mask& mask, std::mt19937& random) {
  for_every_pixel(mask, [&](int x, int y) {
    if (happens(random, kSalt)) mask.set(x, y, !mask.get(x, y));
  });
}

void fray(Mask& mask, std::mt19937& random) {
  const Mask core = erode(mask, 1);
  for_every_pixel(mask, [&](int x, int y) {
    if (mask.get(x, y) && !core.get(x, y) && happens(random, kFrayed)) mask.set(x, y, false);
  });
}

void punch_small_holes(Mask& mask, std::mt19937& random) {
  const Rect box = mask.bounding_box();
  for (int n = 0; n < kHoles && !box.empty(); ++n) {
    const int u = box.x0 + below(random, box.width);
    const int v = box.y0 + below(random, box.height);
    cut_disc(mask, u, v, 1 + below(random, kMaxHoleRadius));
  }
}

void apply_all_three(Mask& mask, std::mt19937& random) {
  punch_small_holes(mask, random);
  fray(mask, random);
  salt(mask, random);
}

void erode_by_a_pixel(Mask& mask, std::mt19937&) { mask = erode(mask, 1); }

/// Cuts a disc around a random pixel of the silhouette. Its diameter is a tenth to a fifth of the
/// shorter side.
void punch_big_hole(Mask& mask, std::mt19937& random) {
  const Rect box = mask.bounding_box();
  if (box.empty()) return;
  const int edge = std::min(box.width, box.height);
  for (;;) {
    const int u = box.x0 + below(random, box.width);
    const int v = box.y0 + below(random, box.height);
    if (!mask.get(u, v)) continue;
    return cut_disc(mask, u, v, edge / 20 + below(random, edge / 20 + 1));
  }
}

/// Removes a third of the width and a quarter of the height, at one side.
void lose_limb(Mask& mask, std::mt19937& random) {
  const Rect box = mask.bounding_box();
  if (box.empty()) return;
  const int y0 = box.y0 + below(random, 3 * box.height / 4);
  const int x0 = below(random, 2) == 0 ? box.x0 : box.x0 + 2 * box.width / 3;
  Mask limb(mask.size());
  for (int y = y0; y < y0 + box.height / 4; ++y) limb.fill_row(y, x0, x0 + box.width / 3);
  mask = difference_of(std::move(mask), limb);
}

void lose_half(Mask& mask, std::mt19937& random) {
  const Rect box = mask.bounding_box();
  const int y0 = below(random, 2) == 0 ? box.y0 : box.y0 + box.height / 2;
  Mask half(mask.size());
  for (int y = y0; y < y0 + box.height / 2; ++y) half.fill_row(y, box.x0, box.x0 + box.width);
  mask = difference_of(std::move(mask), half);
}

void blacken(Mask& mask, std::mt19937&) { mask = Mask(mask.size()); }

constexpr Damage kDamages[] = {
    {"none", true, leave_alone},
    {"salt and pepper, 5 % of all pixels", true, salt},
    {"frayed: every second outline pixel lost", true, fray},
    {"12 holes of 1 to 4 pixels' radius", true, punch_small_holes},
    {"all three", true, apply_all_three},
    {"eroded by a pixel", true, erode_by_a_pixel},
    {"big hole, a quarter of the cameras", false, punch_big_hole},
    {"lost limb, a quarter of the cameras", false, lose_limb},
    {"lost half, a quarter of the cameras", false, lose_half},
    {"black, a quarter of the cameras", false, blacken},
};

}  // namespace

std::span<const Damage> all_damages() { return kDamages; }

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
              ctl::cameras_without(take::load_take_info({arguments.take}),
                                   ctl::parse_names(arguments.leave_out, "--leave-out"))),
        options_(options_of(arguments, take_.rig())),
        hulls_(take_.rig(), options_.bounds, options_.voxel_m, options_.min_views),
        frames_(take_.read(arguments.pulse)) {
    for (size_t c = 0; c < frames_.size(); ++c) {
      if (!frames_[c])
        throw InputError("--pulse: the pulse has no frame of " + take_.rig()[c].name);
      truth_.push_back(intersection_of(frames_[c]->mask,
                                       recon::bounds_mask(options_.bounds, take_.rig()[c].model)));
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
    for (Mask& mask : masks)
      segmentation::MaskCleanup().clean(mask, segmentation::SegmentOptions());
    scores.cleaned = score_of(pointers_to(masks));
    scores.repaired = repaired(masks);
    return scores;
  }

 private:
  static recon::ReconstructOptions options_of(const Arguments& arguments, const Rig& rig) {
    recon::ReconstructOptions options;
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
    const recon::SparseVolume& hull = hulls_.volume(masks);
    const int64_t common = count_common(hull, whole_);
    const auto whole = static_cast<double>(whole_.count());
    return {static_cast<double>(common) / whole,
            static_cast<double>(hull.count() - common) / whole};
  }

  recorded::TakeFrames take_;
  const recon::ReconstructOptions options_;
  recon::LeaveOneOutHull hulls_;
  ctl::SegmentedFrames frames_;
  Masks truth_;
  recon::SparseVolume whole_;
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
  v3d::cli::Program app{
      "Damages the silhouettes of one pulse of a take and prints how much of the hull remains: "
      "without repair, after the segmenter's clean-up, and after v3dctl reconstruct --repair."};
  app.add_option("TAKE", arguments.take).required();
  app.add_option("--bounds", arguments.bounds, "X0,Y0,Z0,X1,Y1,Z1, metres").required();
  app.add_option("--voxel", arguments.voxel, "Edge of a voxel, such as 8mm").required();
  app.add_option("--leave-out", arguments.leave_out, "CAM,...");
  app.add_option("--pulse", arguments.pulse).show_default();
  app.add_option("--first-seed", arguments.first_seed).show_default();
  app.add_option("--seeds", arguments.seeds).show_default().check(v3d::cli::positive_number());
  if (const auto status = app.parse_or_report(argc, argv)) return *status;
  try {
    v3d::bench::try_all(arguments);
  } catch (const v3d::InputError& error) {
    std::fprintf(stderr, "v3d-mask-noise: %s\n", error.what());
    return 2;
  }
  return 0;
}
