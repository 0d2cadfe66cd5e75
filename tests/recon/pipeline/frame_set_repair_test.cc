// Tests of the repair of single frame sets, with faults in silhouettes of the simulated performer.
#include "recon/pipeline/frame_set_repair.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <atomic>

#include "base/geometry/rigid_transform.h"
#include "base/image/mask_operations.h"
#include "sim/rendering/camera_images.h"
#include "sim/rendering/scene.h"

namespace v3d::recon {
namespace {

using testing::IsEmpty;
using testing::Not;

constexpr int kCameras = 12;
constexpr size_t kFaulty = 3;
constexpr ImageSize kSize{512, 384};
constexpr uint64_t kSeed = 3;
constexpr double kSeconds = 0.4;

ReconstructOptions options() {
  return {.bounds = {{-1.5, -1.5, 0}, {1.5, 1.5, 2}}, .voxel_m = 0.025, .min_views = 4};
}

/// Images and true masks of all cameras at one instant.
struct Scene {
  Rig rig = sim::make_rig(kCameras, kSize, kSeed);
  std::vector<Image> images =
      sim::BatchRenderer(rig, sim::RenderOptions{.seed = kSeed}).render_all(kSeconds, 1);
  std::vector<Mask> masks;

  Scene() {
    for (const RigCamera& camera : rig) {
      masks.push_back(sim::true_silhouette(camera, kSeconds, kSeed));
    }
  }
};

const Scene& scene() {
  static const Scene made;
  return made;
}

/// The frames as capture nodes send them.
FrameSet observed(const std::vector<Mask>& masks) {
  FrameSet set{.pulse = 7, .frames = {}};
  for (size_t c = 0; c < masks.size(); ++c) {
    set.frames.push_back(
        observe(scene().rig[c].name, FrameLabel(), scene().images[c].view(), masks[c]));
  }
  return set;
}

/// The true masks without the upper quarter of one.
std::vector<Mask> without_head() {
  std::vector<Mask> masks = scene().masks;
  const Rect box = masks[kFaulty].bounding_box();
  for (int y = box.y0; y < box.y0 + box.height / 4; ++y) {
    for (int x = box.x0; x < box.x0 + box.width; ++x) masks[kFaulty].set(x, y, false);
  }
  return masks;
}

std::optional<RepairedFrameSet> repair(FrameSet& set, const StopRequest& should_stop = {}) {
  return FrameSetRepair(scene().rig, options()).repair(set, should_stop);
}

std::vector<Mask> masks_of(const FrameSet& set) {
  std::vector<Mask> masks;
  for (const Frame& frame : set.frames) masks.push_back(*frame.mask);
  return masks;
}

TEST(FrameSetRepair, changes_no_frame_of_true_silhouettes) {
  FrameSet set = observed(scene().masks);
  const auto repaired = repair(set);
  ASSERT_TRUE(repaired);
  EXPECT_THAT(repaired->faults, IsEmpty());
  EXPECT_THAT(repaired->replaced, IsEmpty());
  EXPECT_EQ(masks_of(set), scene().masks);
}

TEST(FrameSetRepair, fills_a_missing_piece_and_keeps_pixels_and_all_other_masks) {
  const std::vector<Mask> given = without_head();
  FrameSet set = observed(given);
  const Frame before = set.frames[kFaulty];
  const auto repaired = repair(set);
  ASSERT_TRUE(repaired);
  ASSERT_THAT(repaired->faults, Not(IsEmpty()));
  for (const SilhouetteFault& fault : repaired->faults) EXPECT_EQ(fault.camera, kFaulty);
  ASSERT_EQ(repaired->replaced.size(), 1U);
  EXPECT_EQ(repaired->replaced[0].camera, scene().rig[kFaulty].name);
  EXPECT_EQ(repaired->replaced[0].given, given[kFaulty]);
  const Mask& truth = scene().masks[kFaulty];
  const Mask missing = difference_of(truth, given[kFaulty]);
  const Mask still_missing = difference_of(truth, *set.frames[kFaulty].mask);
  EXPECT_LT(2 * still_missing.count(), missing.count());
  EXPECT_EQ(set.frames[kFaulty].roi, before.roi) << "a live frame has no other pixels";
  EXPECT_EQ(set.frames[kFaulty].image.bytes, before.image.bytes);
  for (size_t c = 0; c < given.size(); ++c) {
    if (c == kFaulty) continue;
    EXPECT_EQ(*set.frames[c].mask, given[c]) << c;
  }
}

TEST(FrameSetRepair,
     gives_the_same_masks_for_every_thread_count_and_without_regard_to_other_pulses) {
  FrameSet expected = observed(without_head());
  tbb::task_arena(1).execute([&] { repair(expected); });
  tbb::task_arena(3).execute([&] {
    FrameSetRepair repairer(scene().rig, options());
    FrameSet other = observed(scene().masks);
    repairer.repair(other);
    FrameSet set = observed(without_head());
    repairer.repair(set);
    EXPECT_EQ(masks_of(set), masks_of(expected));
  });
}

TEST(FrameSetRepair, removes_the_frame_of_a_camera_that_is_wrong_as_a_whole) {
  std::vector<Mask> masks = scene().masks;
  masks[kFaulty] = Mask(kSize);
  FrameSet set = observed(masks);
  const auto repaired = repair(set);
  ASSERT_TRUE(repaired);
  ASSERT_EQ(repaired->faults.size(), 1U);
  EXPECT_EQ(repaired->faults[0].kind, SilhouetteFaultKind::kWholeCamera);
  EXPECT_EQ(set.frames.size(), size_t{kCameras - 1});
  EXPECT_EQ(usable_frames(scene().rig, set)[kFaulty], nullptr);
}

TEST(FrameSetRepair, leaves_the_set_unchanged_when_it_is_stopped_at_any_time) {
  std::atomic<int> asked = 0;
  FrameSet whole = observed(without_head());
  ASSERT_TRUE(repair(whole, [&] { return ++asked < 0; }));
  const int questions = asked;
  EXPECT_GT(questions, 2 * kCameras) << "once for each camera in each iteration";
  for (const int stop_at : {1, 2, kCameras, questions / 2, questions}) {
    FrameSet set = observed(without_head());
    asked = 0;
    EXPECT_FALSE(repair(set, [&] { return ++asked >= stop_at; })) << stop_at;
    EXPECT_EQ(masks_of(set), without_head()) << stop_at;
    EXPECT_EQ(asked, stop_at) << "it is not asked again";
  }
}

TEST(FrameSetRepair, restores_replaced_masks_and_left_out_cameras) {
  std::vector<Mask> masks = without_head();
  masks[8] = Mask(kSize);
  FrameSet set = observed(masks);
  auto repaired = repair(set);
  ASSERT_TRUE(repaired);
  ASSERT_EQ(repaired->replaced.size(), 2U);
  restore_masks(std::move(repaired->replaced), set);
  ASSERT_EQ(set.frames.size(), size_t{kCameras});
  for (const Frame& frame : set.frames) {
    const auto c = static_cast<size_t>(find_camera(scene().rig, frame.camera));
    EXPECT_EQ(*frame.mask, masks[c]) << frame.camera;
  }
}

}  // namespace
}  // namespace v3d::recon
