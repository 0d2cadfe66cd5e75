// Tests with faults in the silhouettes of the simulated performer.
#include "recon/silhouettes/silhouette_repair.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "base/geometry/rigid_transform.h"
#include "base/image/mask_operations.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "sim/rendering/camera_images.h"
#include "sim/rendering/scene.h"

namespace v3d::recon {
namespace {

using testing::IsEmpty;

constexpr int kCameras = 12;
constexpr ImageSize kSize{512, 384};
constexpr uint64_t kSeed = 3;
constexpr double kVoxel = 0.025;
constexpr int kMinViews = 4;
constexpr double kSeconds = 0.4;
const Box kSpace{{-1.5, -1.5, 0}, {1.5, 1.5, 2}};

/// Masks and frames of all cameras at one instant.
struct Scene {
  Rig rig = sim::make_rig(kCameras, kSize, kSeed);
  std::vector<Mask> masks;
  std::vector<Frame> frames;

  explicit Scene(double seconds) {
    const sim::RenderOptions options{.seed = kSeed};
    std::vector<Image> images = sim::BatchRenderer(rig, options).render_all(seconds, 1);
    for (size_t c = 0; c < rig.size(); ++c) {
      masks.push_back(sim::true_silhouette(rig[c], seconds, kSeed));
      Frame frame;
      frame.camera = rig[c].name;
      frame.sensor_size = kSize;
      frame.roi = {0, 0, kSize.width, kSize.height};
      frame.image = std::move(images[c]);
      frames.push_back(std::move(frame));
    }
  }
};

const Scene& scene() {
  static const Scene made(kSeconds);
  return made;
}

std::vector<const Mask*> pointers(const std::vector<Mask>& masks) {
  std::vector<const Mask*> all;
  for (const Mask& mask : masks) all.push_back(&mask);
  return all;
}
std::vector<const Mask*> pointers(const std::vector<std::optional<Mask>>& masks) {
  std::vector<const Mask*> all;
  for (const auto& mask : masks) all.push_back(mask ? &*mask : nullptr);
  return all;
}

RepairedSilhouettes repair(const std::vector<Mask>& masks, bool with_images = true) {
  SilhouetteRepair repairer(scene().rig, kSpace, kVoxel, kMinViews);
  std::vector<const Frame*> frames;
  for (const Frame& frame : scene().frames) frames.push_back(with_images ? &frame : nullptr);
  return repairer.repair(pointers(masks), frames);
}

SparseVolume volume(std::span<const Mask* const> masks) {
  LeaveOneOutHull hulls(scene().rig, kSpace, kVoxel, kMinViews);
  return hulls.volume(masks);
}

/// Number of differing voxels between the hull of the masks and that of the true ones.
int64_t voxels_wrong(std::span<const Mask* const> masks) {
  return count_differing(volume(masks), volume(pointers(scene().masks)));
}

std::vector<Mask> with_hole(size_t camera, Rect hole) {
  std::vector<Mask> masks = scene().masks;
  for (int y = hole.y0; y < hole.y0 + hole.height; ++y) {
    for (int x = hole.x0; x < hole.x0 + hole.width; ++x) masks[camera].set(x, y, false);
  }
  return masks;
}

/// A pixel inside the silhouette, in the middle of its widest row.
Rect solid_part(const Mask& mask, int edge) {
  const Mask core = erode(mask, edge / 2 + 2);
  const Rect box = core.bounding_box();
  for (int y = box.y0 + box.height / 3;; ++y) {
    for (int x = box.x0; x < box.x0 + box.width; ++x) {
      if (core.get(x, y)) return {x - edge / 2, y - edge / 2, edge, edge};
    }
  }
}

TEST(SilhouetteRepair, finds_no_fault_in_true_silhouettes) {
  const RepairedSilhouettes repaired = repair(scene().masks);
  EXPECT_THAT(repaired.faults, IsEmpty());
  for (size_t c = 0; c < repaired.masks.size(); ++c)
    EXPECT_EQ(*repaired.masks[c], scene().masks[c]);
}

TEST(SilhouetteRepair, fills_foreground_that_one_camera_lacks) {
  for (const size_t camera : {1U, 6U}) {
    const Rect box = scene().masks[camera].bounding_box();
    const auto masks = with_hole(camera, {box.x0, box.y0, box.width, box.height / 4});
    const RepairedSilhouettes repaired = repair(masks);
    ASSERT_THAT(repaired.faults, testing::Not(IsEmpty())) << camera;
    for (const SilhouetteFault& fault : repaired.faults) {
      EXPECT_EQ(fault.camera, camera);
      EXPECT_EQ(fault.kind, SilhouetteFaultKind::kMissingPiece);
    }
    EXPECT_LE(3 * voxels_wrong(pointers(repaired.masks)), voxels_wrong(pointers(masks))) << camera;
  }
}

TEST(SilhouetteRepair, fills_a_hole_with_consistent_colours_and_keeps_one_without_colours) {
  constexpr size_t kCamera = 0;
  const auto masks = with_hole(kCamera, solid_part(scene().masks[kCamera], 16));
  ASSERT_GT(voxels_wrong(pointers(masks)), 0);
  const RepairedSilhouettes repaired = repair(masks);
  EXPECT_EQ(repaired.faults.size(), 1U);
  EXPECT_LE(3 * voxels_wrong(pointers(repaired.masks)), voxels_wrong(pointers(masks)));
  EXPECT_THAT(repair(masks, false).faults, IsEmpty());
}

TEST(SilhouetteRepair, fills_regions_with_consistent_colours_that_no_camera_contradicts) {
  // From the outline inwards, so it is no hole; the frames of the other cameras are complete.
  constexpr size_t kCamera = 3;
  const Rect hole = solid_part(scene().masks[kCamera], 16);
  const auto masks = with_hole(kCamera, {0, hole.y0, hole.x0 + hole.width, hole.height});
  const RepairedSilhouettes repaired = repair(masks);
  ASSERT_EQ(repaired.faults.size(), 1U);
  EXPECT_EQ(repaired.faults[0].camera, kCamera);
  EXPECT_EQ(repaired.faults[0].kind, SilhouetteFaultKind::kMissingPiece);
  EXPECT_LE(3 * voxels_wrong(pointers(repaired.masks)), voxels_wrong(pointers(masks)));
}

TEST(SilhouetteRepair, fills_foreground_that_several_cameras_lack) {
  std::vector<Mask> masks = scene().masks;
  for (const size_t camera : {1U, 5U, 8U}) {
    const Rect box = masks[camera].bounding_box();
    for (int y = box.y0; y < box.y0 + box.height / 3; ++y) {
      for (int x = box.x0; x < box.x0 + box.width; ++x) masks[camera].set(x, y, false);
    }
  }
  const RepairedSilhouettes repaired = repair(masks);
  std::set<size_t> named;
  for (const SilhouetteFault& fault : repaired.faults) named.insert(fault.camera);
  EXPECT_THAT(named, testing::ElementsAre(1, 5, 8));
  EXPECT_LE(10 * voxels_wrong(pointers(repaired.masks)), voxels_wrong(pointers(masks)));
}

TEST(SilhouetteRepair, removes_foreground_that_no_other_camera_sees) {
  constexpr size_t kCamera = 4;
  std::vector<Mask> masks = scene().masks;
  for (int y = 20; y < 60; ++y) masks[kCamera].fill_row(y, 20, 70);
  const RepairedSilhouettes repaired = repair(masks);
  ASSERT_EQ(repaired.faults.size(), 1U);
  EXPECT_EQ(repaired.faults[0].kind, SilhouetteFaultKind::kPhantomPiece);
  EXPECT_EQ(repaired.faults[0].region.x0, 20);
  EXPECT_EQ(repaired.faults[0].pixels, 40 * 50);
  EXPECT_EQ(*repaired.masks[kCamera], scene().masks[kCamera]);
}

/// The mask with a part of a disc at the right, this many pixels beyond its outline.
std::vector<Mask> with_bulge(size_t camera, int pixels) {
  constexpr int kRadius = 20;
  std::vector<Mask> masks = scene().masks;
  Mask& mask = masks[camera];
  const Rect box = mask.bounding_box();
  const int row = box.y0 + box.height * 3 / 10;
  int edge = box.x0 + box.width - 1;
  while (!mask.get(edge, row)) --edge;
  for (int v = -kRadius; v <= kRadius; ++v) {
    const int half = static_cast<int>(std::sqrt(kRadius * kRadius - v * v));
    const int middle = edge + pixels - kRadius;
    mask.fill_row(row + v, middle - half, middle + half);
  }
  return masks;
}

TEST(SilhouetteRepair, removes_small_bulges_of_the_outline) {
  for (const size_t camera : {0U, 5U, 8U, 9U}) {
    const RepairedSilhouettes repaired = repair(with_bulge(camera, 8), false);
    ASSERT_EQ(repaired.faults.size(), 1U) << camera;
    EXPECT_EQ(repaired.faults[0].camera, camera);
    EXPECT_EQ(repaired.faults[0].kind, SilhouetteFaultKind::kPhantomPiece);
  }
}

TEST(SilhouetteRepair, excludes_cameras_with_empty_or_full_masks) {
  std::vector<Mask> masks = scene().masks;
  masks[2] = Mask(kSize);
  masks[9] = Mask(kSize);
  for (int y = 0; y < kSize.height; ++y) masks[5].fill_row(y, 0, kSize.width);
  const RepairedSilhouettes repaired = repair(masks);
  std::vector<size_t> left_out;
  for (const SilhouetteFault& fault : repaired.faults) {
    EXPECT_EQ(fault.kind, SilhouetteFaultKind::kWholeCamera);
    left_out.push_back(fault.camera);
  }
  EXPECT_THAT(left_out, testing::ElementsAre(2, 5, 9));
  for (const size_t c : left_out) EXPECT_FALSE(repaired.masks[c]);
  EXPECT_LE(3 * voxels_wrong(pointers(repaired.masks)), voxels_wrong(pointers(masks)));
}

/// Masks of all cameras this many pulses of 10 Hz later.
std::vector<Mask> masks_at(int pulses) {
  std::vector<Mask> masks;
  for (const RigCamera& camera : scene().rig) {
    masks.push_back(sim::true_silhouette(camera, kSeconds + 0.1 * pulses, kSeed));
  }
  return masks;
}

/// Repairs pulse 0; `camera` shows the pulses `shown` at -1, 0 and 1.
RepairedSilhouettes mend_late(size_t camera, std::array<int, 3> shown, std::vector<Mask>& masks) {
  std::vector<Mask> before = masks_at(-1);
  std::vector<Mask> after = masks_at(1);
  masks = scene().masks;
  before[camera] = masks_at(shown[0])[camera];
  masks[camera] = masks_at(shown[1])[camera];
  after[camera] = masks_at(shown[2])[camera];
  SilhouetteRepair repairer(scene().rig, kSpace, kVoxel, kMinViews);
  const std::vector<const Frame*> no_frames(scene().rig.size(), nullptr);
  const auto all_before = pointers(before);
  const auto all_after = pointers(after);
  return repairer.repair(pointers(masks), no_frames, {.before = all_before, .after = all_after});
}

TEST(SilhouetteRepair, reports_a_camera_one_pulse_late_and_uses_its_next_frame) {
  constexpr size_t kCamera = 4;
  std::vector<Mask> masks;
  const RepairedSilhouettes repaired = mend_late(kCamera, {-2, -1, 0}, masks);
  ASSERT_EQ(repaired.faults.size(), 1U);
  EXPECT_EQ(repaired.faults[0].camera, kCamera);
  EXPECT_EQ(repaired.faults[0].kind, SilhouetteFaultKind::kPulseLate);
  EXPECT_THAT(repaired.shown_later, testing::ElementsAre(kCamera));
  EXPECT_EQ(*repaired.masks[kCamera], scene().masks[kCamera]);
}

/// RepairedSilhouettes::shown_later of cameras 4 and `other` one pulse late, which change their
/// places in the rig if `swapped`.
std::vector<size_t> cameras_shown_later(size_t other, bool swapped) {
  constexpr size_t kCamera = 4;
  Rig rig = scene().rig;
  std::vector<Mask> before = masks_at(-1), now = scene().masks, after = masks_at(1);
  for (const size_t late : {kCamera, other}) {
    after[late] = std::exchange(now[late], before[late]);
    before[late] = masks_at(-2)[late];
  }
  if (swapped) {
    std::swap(rig[kCamera], rig[other]);
    for (std::vector<Mask>* masks : {&before, &now, &after}) {
      std::swap((*masks)[kCamera], (*masks)[other]);
    }
  }
  SilhouetteRepair repairer(rig, kSpace, kVoxel, kMinViews);
  const std::vector<const Frame*> no_frames(rig.size(), nullptr);
  const auto all_before = pointers(before), all_after = pointers(after);
  return repairer.repair(pointers(now), no_frames, {.before = all_before, .after = all_after})
      .shown_later;
}

TEST(SilhouetteRepair, lists_late_cameras_ascending_and_not_by_their_excess) {
  int pairs = 0;
  for (const size_t other : {1U, 7U, 9U}) {
    for (const bool swapped : {false, true}) {
      const std::vector<size_t> found = cameras_shown_later(other, swapped);
      EXPECT_TRUE(std::ranges::is_sorted(found)) << other << (swapped ? ", swapped" : "");
      pairs += found.size() == 2 ? 1 : 0;
    }
  }
  EXPECT_GT(pairs, 0) << "one camera has no order";
}

TEST(SilhouetteRepair, interpolates_a_repeated_frame) {
  constexpr size_t kCamera = 4;
  std::vector<Mask> masks;
  const RepairedSilhouettes repaired = mend_late(kCamera, {-1, -1, 1}, masks);
  ASSERT_EQ(repaired.faults.size(), 1U);
  EXPECT_EQ(repaired.faults[0].kind, SilhouetteFaultKind::kPulseLate);
  EXPECT_THAT(repaired.shown_later, IsEmpty());
  EXPECT_LT(voxels_wrong(pointers(repaired.masks)), voxels_wrong(pointers(masks)));
}

TEST(SilhouetteRepair, repairs_a_pulse_without_its_neighbours) {
  std::vector<Mask> masks;
  const RepairedSilhouettes late = mend_late(4, {-2, -1, 0}, masks);
  const RepairedSilhouettes by_itself = repair(masks, false);
  EXPECT_EQ(late.alone, by_itself.masks);
  EXPECT_NE(late.alone, late.masks);
  EXPECT_EQ(by_itself.alone, by_itself.masks);
}

TEST(SilhouetteRepair, reports_no_late_camera_when_all_are_synchronous) {
  std::vector<Mask> masks;
  EXPECT_THAT(mend_late(4, {-1, 0, 1}, masks).faults, IsEmpty());
}

TEST(SilhouetteRepair, accepts_background_of_the_only_camera_that_sees_it) {
  Mesh legs = shapes::box({-0.1F, -0.3F, 0}, {0.1F, -0.1F, 0.9F});
  const Mesh other = shapes::box({-0.1F, 0.1F, 0}, {0.1F, 0.3F, 0.9F});
  const auto first = static_cast<uint32_t>(legs.vertices.size());
  legs.vertices.insert(legs.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const auto& t : other.triangles) {
    legs.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
  Rig rig;
  const Eigen::Vector3d positions[] = {
      {4, 0, 0.5}, {0, 4, 0.5}, {0, -4, 0.7}, {0.4, 4, 1}, {-0.4, 4, 1.2}};
  for (const auto& position : positions) {
    rig.push_back({"cam" + std::to_string(rig.size()),
                   shapes::camera(position, {0, 0, 0.45}, {320, 240}, 400)});
  }
  const std::vector<Mask> masks = draw_silhouettes(legs, models_of(rig));
  SilhouetteRepair repairer(rig, {{-0.5, -0.5, -0.1}, {0.5, 0.5, 1}}, 0.02, 3);
  const std::vector<const Frame*> no_frames(rig.size(), nullptr);
  const RepairedSilhouettes repaired = repairer.repair(pointers(masks), no_frames);
  EXPECT_THAT(repaired.faults, IsEmpty());
  EXPECT_EQ(*repaired.masks[0], masks[0]);
}

}  // namespace
}  // namespace v3d::recon
