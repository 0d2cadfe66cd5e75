#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/geometry/rigid_transform.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "recon/silhouettes/frame_lag.h"
#include "recon/silhouettes/leave_one_out_hull.h"

namespace v3d::recon {
namespace {

constexpr int kPulses = 12;
const Box kSpace{{-0.6, -0.6, -0.6}, {0.6, 0.6, 0.6}};

Rig ring_of(int cameras) {
  Rig rig;
  for (int i = 0; i < cameras; ++i) {
    const double angle = 2 * std::numbers::pi * i / cameras;
    rig.push_back({"cam" + std::to_string(i),
                   shapes::camera({3 * std::cos(angle), 3 * std::sin(angle), i % 2 ? 1.0 : -1.0},
                                  {0, 0, 0}, {160, 120}, 250)});
  }
  return rig;
}

/// A ball on a circle around the centre, which moves by `radians` each pulse.
Mask silhouette(const CameraModel& camera, int pulse, double radians) {
  const double angle = radians * pulse;
  const Eigen::Vector3f centre(static_cast<float>(0.3 * std::cos(angle)),
                               static_cast<float>(0.3 * std::sin(angle)),
                               static_cast<float>(0.1 * std::sin(3 * angle)));
  return draw_silhouette(shapes::sphere(centre, 0.2F, 16), camera);
}

/// The masks of the pulse itself.
std::vector<const Mask*> now_of(const std::vector<MaskWindow>& windows) {
  std::vector<const Mask*> masks;
  for (const MaskWindow& window : windows) masks.push_back(window[kMaxPulsesOff]);
  return masks;
}

/// The detected lags of all cameras in a take in which camera c is `late[c]` pulses late.
std::vector<int> lateness(const std::vector<int>& late, double radians) {
  const Rig rig = ring_of(static_cast<int>(late.size()));
  LeaveOneOutHull hulls(rig, kSpace, 0.02, 3);
  SyncCheck meter(rig);
  for (int pulse = 0; pulse < kPulses; ++pulse) {
    std::vector<std::array<Mask, kShifts>> masks(rig.size());
    std::vector<MaskWindow> windows(rig.size());
    for (size_t c = 0; c < rig.size(); ++c) {
      for (int shift = 0; shift < kShifts; ++shift) {
        masks[c][shift] =
            silhouette(rig[c].model, pulse + shift - kMaxPulsesOff - late[c], radians);
        windows[c][shift] = &masks[c][shift];
      }
    }
    meter.add(windows, hulls.silhouettes_of_each(now_of(windows)));
  }
  std::vector<int> found;
  for (const CameraSync& camera : meter.result()) found.push_back(camera.pulses_late());
  return found;
}

TEST(SyncCheckTest, finds_no_fault_with_cameras_in_step) {
  EXPECT_THAT(lateness({0, 0, 0, 0, 0, 0, 0, 0}, 0.1), testing::Each(0));
}

TEST(SyncCheckTest, reports_the_late_camera_and_its_lag) {
  const std::vector<int> late = {0, 0, 0, 1, 0, 0, 0, 0};
  EXPECT_EQ(lateness(late, 0.1), late);
  const std::vector<int> later = {0, 0, 2, 0, 0, 0, 0, 0};
  EXPECT_EQ(lateness(later, 0.1), later);
}

TEST(SyncCheckTest, reports_the_early_camera) {
  const std::vector<int> early = {0, 0, 0, 0, 0, -1, 0, 0};
  EXPECT_EQ(lateness(early, 0.1), early);
}

TEST(SyncCheckTest, has_no_result_for_a_still_body) {
  EXPECT_THAT(lateness({0, 0, 0, 2, 0, 0, 0, 0}, 0), testing::Each(0));
}

TEST(SyncCheckTest, does_not_compare_a_camera_with_a_gap) {
  const Rig rig = ring_of(4);
  LeaveOneOutHull hulls(rig, kSpace, 0.05, 3);
  SyncCheck meter(rig);
  std::vector<Mask> masks;
  for (const RigCamera& camera : rig) masks.push_back(silhouette(camera.model, 0, 0));
  std::vector<MaskWindow> windows(4);
  for (size_t c = 0; c < 4; ++c) windows[c].fill(&masks[c]);
  windows[1][0] = nullptr;
  windows[2].fill(nullptr);
  meter.add(windows, hulls.silhouettes_of_each(now_of(windows)));
  std::vector<int64_t> frames;
  for (const CameraSync& camera : meter.result()) frames.push_back(camera.frames);
  EXPECT_THAT(frames, testing::ElementsAre(1, 0, 0, 1));
}

}  // namespace
}  // namespace v3d::recon
