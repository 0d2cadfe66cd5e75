#include <gtest/gtest.h>

#include "sim/cameras/triggers.h"

namespace v3d::sim {
namespace {

using io::ActionCommand;
using io::ActionStatus;

const ActionState kCamera{.device_key = 1,
                          .group_key = 2,
                          .group_mask = 0b0110,
                          .is_controlled = true,
                          .follows_ptp = true};
const ActionCommand kCommand{.device_key = 1, .group_key = 2, .group_mask = 0b0100};

TEST(ActionCommands, reach_a_camera_with_the_same_keys_and_a_common_bit_of_the_mask) {
  EXPECT_TRUE(obeys(kCamera, kCommand));
  ActionCommand other = kCommand;
  other.device_key = 3;
  EXPECT_FALSE(obeys(kCamera, other)) << "wrong device key";
  other = kCommand;
  other.group_key = 3;
  EXPECT_FALSE(obeys(kCamera, other)) << "wrong group key";
  other = kCommand;
  other.group_mask = 0b1001;
  EXPECT_FALSE(obeys(kCamera, other)) << "wrong mask";
}

TEST(ActionCommands, need_a_program_that_controls_the_camera_or_unconditional_mode) {
  ActionState camera = kCamera;
  camera.is_controlled = false;
  EXPECT_FALSE(obeys(camera, kCommand));
  camera.is_unconditional = true;
  EXPECT_TRUE(obeys(camera, kCommand));
}

TEST(ActionCommands, with_a_time_need_ptp_and_a_time_that_has_not_passed) {
  const MonotonicInstant now(std::chrono::seconds(100));
  const Duration ms = std::chrono::milliseconds(1);
  ActionCommand scheduled = kCommand;
  scheduled.time_ns = 1;
  EXPECT_EQ(status_of(kCamera, scheduled, now + ms, now), ActionStatus::kSuccess);
  EXPECT_EQ(status_of(kCamera, scheduled, now - ms, now), ActionStatus::kLate);
  ActionState unlocked = kCamera;
  unlocked.follows_ptp = false;
  EXPECT_EQ(status_of(unlocked, scheduled, now + ms, now), ActionStatus::kNoReferenceTime);
  EXPECT_EQ(status_of(unlocked, kCommand, now - ms, now), ActionStatus::kSuccess);
}

TEST(ActionCommands, with_any_time_have_an_instant_on_the_clock_of_this_host) {
  EXPECT_LT(from_ptp(0), Monotonic::now());
  EXPECT_GT(from_ptp(INT64_MAX), Monotonic::now());
}

}  // namespace
}  // namespace v3d::sim
