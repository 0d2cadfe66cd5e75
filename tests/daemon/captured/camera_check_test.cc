#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "capture/fed_camera.h"
#include "daemon/captured/unrecorded_trains.h"
#include "daemon/control/reply_json.h"

namespace v3d::captured {
namespace {

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";
constexpr int64_t kFrames = 24;
constexpr Duration kPeriod = std::chrono::milliseconds(1);  // of the clock of FrameSource

/// A busy host has enough time to examine all frames.
const CameraCheck::Setup kSetup{
    .rate_hz = 50, .background = {}, .backlog_time = std::chrono::minutes(1)};

/// An armed camera whose frames take milliseconds to examine.
struct LargeCamera {
  LargeCamera() {
    source->size = {1024, 768};
    worker.arm(kPeriod);
  }
  bool is_ready() const {
    return capture::eventually(
        [&] { return worker.status().state == capture::CameraState::kReady; });
  }
  /// The frames of all pulses wait in the queue.
  bool exposes_all() const {
    for (int64_t pulse = 0; pulse < kFrames; ++pulse) source->expose();
    return capture::eventually([&] { return worker.status().frames == kFrames; });
  }

  std::shared_ptr<capture::FrameSource> source = std::make_shared<capture::FrameSource>();
  capture::CameraWorker worker{"cam07",
                               [h = source] { return std::make_unique<capture::FedCamera>(h); },
                               {.queue_frames = kFrames, .reopen_after = std::chrono::hours(1)}};
};

TEST(CheckOfCameras, examines_all_frames_that_have_arrived_before_its_end) {
  bus::Bus bus(kUrl);
  LargeCamera first, second;
  ASSERT_TRUE(first.is_ready() && second.is_ready());
  ASSERT_TRUE(first.exposes_all() && second.exposes_all());
  CameraCheck check({&first.worker, &second.worker}, kSetup, bus);
  const std::vector<CheckedCamera> checked = check.close(kFrames);
  ASSERT_EQ(checked.size(), 2U);
  for (const CheckedCamera& camera : checked) {
    EXPECT_EQ(camera.pulses.received, kFrames);
    EXPECT_THAT(camera.pulses.missing, testing::IsEmpty());
    EXPECT_EQ(camera.dropped, 0);
  }
}

TEST(CheckOfCameras, counts_frames_that_the_node_was_too_slow_to_examine) {
  bus::Bus bus(kUrl);
  LargeCamera camera;
  ASSERT_TRUE(camera.is_ready());
  ASSERT_TRUE(camera.exposes_all());
  camera.source->expose();  // the queue is full
  ASSERT_TRUE(capture::eventually([&] { return camera.worker.status().frames == kFrames + 1; }));
  CameraCheck check({&camera.worker}, kSetup, bus);
  const CheckedCamera checked = check.close(kFrames + 1).front();
  EXPECT_EQ(checked.dropped, 1);
  EXPECT_EQ(checked.pulses.missing, std::vector<int64_t>{0});
}

TEST(CheckOfCameras, has_a_reply_that_fits_when_all_frames_of_many_pulses_are_missing) {
  constexpr int64_t kPulses = 100'000;
  CheckedCamera camera;
  for (int64_t pulse = 0; pulse < kPulses; ++pulse) camera.pulses.missing.push_back(pulse);
  const std::vector<CheckedCamera> cameras(15, camera);
  take::Ledger ledger;
  ledger.commanded = kPulses;
  const std::vector<std::string> none;
  const std::optional<CheckedSound> no_sound;
  const std::string detail = check_json(
      {.ledger = ledger, .rate_hz = 25, .cameras = cameras, .not_ready = none, .sound = no_sound});
  EXPECT_LE(detail.size(), control::kMaxDetailBytes);
  EXPECT_THAT(detail, testing::HasSubstr("\"missing_count\":100000"));
}

}  // namespace
}  // namespace v3d::captured
