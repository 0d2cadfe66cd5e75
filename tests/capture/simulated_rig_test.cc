// Compares the segmentation of the simulated studio with the true silhouette.
#include <gtest/gtest.h>

#include <vector>

#include "capture/segmentation/segmenter.h"
#include "sim/rendering/scene.h"

namespace v3d::capture {
namespace {

segmentation::BackgroundModel learn_empty_room(const RigCamera& camera,
                                               const sim::RenderOptions& options) {
  std::vector<Image> plates;
  for (uint64_t i = 0; i < 6; ++i) {
    plates.push_back(sim::render(camera, 0, false, 1000 + i, options));
  }
  std::vector<ImageView> views;
  for (const Image& plate : plates) views.push_back(plate.view());
  return segmentation::learn_background(views);
}

TEST(SegmenterOnSimulatedRig, finds_the_swordsman_in_bayer_images) {
  const sim::RenderOptions options;
  const Rig rig = sim::make_rig(15, {1024, 768}, options.seed);
  for (const size_t c : {0U, 7U}) {
    segmentation::Segmenter segmenter(learn_empty_room(rig[c], options), {});
    for (const double t : {0.3, 1.7}) {
      const Image image = sim::render(rig[c], t, true, 1, options);
      const Mask truth = sim::true_silhouette(rig[c], t, options.seed);
      EXPECT_GT(intersection_over_union(segmenter.segment(image.view()), truth), 0.97)
          << rig[c].name << " at " << t << " s";
    }
  }
}

}  // namespace
}  // namespace v3d::capture
