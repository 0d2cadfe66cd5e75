// v3d-refine-trials: tests `v3dctl calibrate refine` on simulated rigs with known calibration
// errors.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdio>
#include <vector>

#include "base/image/mask_operations.h"
#include "calib/rig/silhouette_refinement.h"
#include "capture/segmentation/segmenter.h"
#include "cli/command.h"
#include "sim/rendering/camera_images.h"
#include "sim/rendering/scene.h"
#include "support/displaced_rig.h"

namespace v3d::bench {

// Trials of the calibration refinement on rigs with known errors.

struct RefineTrials {
  int studios = 6;
  int instants = 30;
  int cameras = 15;  ///< number of cameras of 1024x768
};

/// Mean errors over the studios. An error is the RMS distance, in pixels over all cameras, of
/// projected points between two rigs, after alignment of their world frames.
struct RefineScore {
  bool segmented = false;  ///< segmented silhouettes instead of true ones
  double disturbed_px = 0;
  double before_px = 0;
  double after_px = 0;
  double worst_px = 0;          ///< largest error of a studio after the refinement
  double planes_before_px = 0;  ///< disagreement of epipolar tangents, as the command reports it
  double planes_after_px = 0;
  int changed = 0;  ///< number of studios whose rig was changed
};

std::vector<RefineScore> try_refining(const RefineTrials& trials);

namespace {

using Masks = std::vector<std::vector<Mask>>;  // by instant, by camera

constexpr double kSecondsApart = 0.37;

Masks true_masks(const Rig& rig, const RefineTrials& trials, uint64_t seed) {
  Masks masks(trials.instants, std::vector<Mask>(rig.size()));
  tbb::parallel_for(size_t{0}, rig.size(), [&](size_t c) {
    for (int i = 0; i < trials.instants; ++i) {
      masks[i][c] = sim::true_silhouette(rig[c], kSecondsApart * i, seed);
    }
  });
  return masks;
}

/// Silhouettes as `v3dctl calibrate refine` gets them: segmented and opened.
Masks segmented_masks(const Rig& rig, const RefineTrials& trials, uint64_t seed) {
  constexpr uint64_t kPlates = 8;
  constexpr int kSpeck = 2;
  sim::RenderOptions options;
  options.seed = seed;
  sim::BatchRenderer film(rig, options);
  std::vector<std::vector<Image>> plates;
  for (uint64_t i = 0; i < kPlates; ++i) plates.push_back(film.render_all({}, i));
  std::vector<segmentation::Segmenter> segmenters;
  for (size_t c = 0; c < rig.size(); ++c) {
    std::vector<ImageView> views;
    for (const auto& plate : plates) views.push_back(plate[c].view());
    segmenters.emplace_back(segmentation::learn_background(views), segmentation::SegmentOptions());
  }
  Masks masks;
  for (int i = 0; i < trials.instants; ++i) {
    const std::vector<Image> images =
        film.render_all(kSecondsApart * i, kPlates + static_cast<uint64_t>(i));
    masks.emplace_back();
    for (size_t c = 0; c < rig.size(); ++c) {
      masks.back().push_back(open(segmenters[c].segment(images[c].view()), kSpeck));
    }
  }
  return masks;
}

std::vector<calib::SilhouetteSet> sets_of(const Masks& masks) {
  std::vector<calib::SilhouetteSet> sets;
  for (const auto& instant : masks) {
    sets.emplace_back();
    for (const Mask& mask : instant) sets.back().push_back(&mask);
  }
  return sets;
}

struct Studio {
  Rig truth;
  Masks exact, segmented;
};

RefineScore try_one(const std::vector<Studio>& studios, bool segmented, double px) {
  RefineScore score{.segmented = segmented, .disturbed_px = px};
  for (size_t s = 0; s < studios.size(); ++s) {
    const Studio& studio = studios[s];
    const Rig before = test::displaced(studio.truth, px, 77 + s);
    const auto result = calib::refine_by_silhouettes(
        before, sets_of(segmented ? studio.segmented : studio.exact), {});
    const double after = test::error_px(result.rig, studio.truth);
    score.before_px += test::error_px(before, studio.truth) / static_cast<double>(studios.size());
    score.after_px += after / static_cast<double>(studios.size());
    score.worst_px = std::max(score.worst_px, after);
    score.changed += result.better;
    score.planes_before_px += result.before_px / static_cast<double>(studios.size());
    score.planes_after_px += result.after_px / static_cast<double>(studios.size());
  }
  return score;
}

}  // namespace

std::vector<RefineScore> try_refining(const RefineTrials& trials) {
  std::vector<Studio> studios;
  for (int s = 0; s < trials.studios; ++s) {
    const auto seed = static_cast<uint64_t>(s) + 1;
    const Rig rig = sim::make_rig(trials.cameras, {1024, 768}, seed);
    studios.push_back({rig, true_masks(rig, trials, seed), segmented_masks(rig, trials, seed)});
  }
  std::vector<RefineScore> scores;
  for (const bool segmented : {false, true}) {
    for (const double px : {0.0, 0.3, 1.0, 2.0, 4.0}) {
      scores.push_back(try_one(studios, segmented, px));
    }
  }
  return scores;
}

}  // namespace v3d::bench

int main(int argc, char** argv) {
  using namespace v3d::bench;
  RefineTrials trials;
  v3d::cli::Program app{
      "Disturbs the cameras of simulated studios by 0 to 4 pixels, refines them by the performer's "
      "silhouettes, and compares the result with the truth."};
  app.add_option("--studios", trials.studios, "Studios for every line of the table (6)");
  app.add_option("--instants", trials.instants, "Instants in each (30)");
  app.add_option("--cameras", trials.cameras, "Cameras in each (15)");
  if (const auto status = app.parse_or_report(argc, argv)) return *status;
  std::printf("%-12s %9s %10s %10s %10s %8s %16s\n", "silhouettes", "off by", "before", "after",
              "worst", "changed", "planes disagree");
  for (const RefineScore& s : try_refining(trials)) {
    std::printf("%-12s %6.1f px %7.2f px %7.2f px %7.2f px %3d of %d %6.2f, %5.2f px\n",
                s.segmented ? "segmented" : "true", s.disturbed_px, s.before_px, s.after_px,
                s.worst_px, s.changed, trials.studios, s.planes_before_px, s.planes_after_px);
  }
  return 0;
}
