// Scenario tests of what an operator uses before a take: check, previews, live calibration, health.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/image/image_files.h"
#include "studio4.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::within;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

constexpr int kPulses = 10;

class MonitoredStudio : public test::Studio4 {
 protected:
  using Studio4::Studio4;
  /// Runs a live calibration, which records a take and fails because no board is visible.
  void calibrate_live() {
    EXPECT_THAT(run_v3dctl({"calibrate", "rig", "--board", "chess:9x6:25mm", "--live", "1", "--out",
                            folder_ / "new.toml"},
                           2),
                HasSubstr("cam01: too few boards: no chess:9x6:25mm in any of 5 images"));
  }
};

/// At 5 Hz: a check waits ten periods, at most a second, for its last frames.
class CheckedStudio : public MonitoredStudio {
 protected:
  CheckedStudio() : MonitoredStudio({.rate = "5"}) {}
};

TEST_F(CheckedStudio, checks_its_cameras_without_recording_and_sends_previews) {
  take_name_ = "check";
  client_->next_preview(Monotonic::now());
  const control::Answer armed = command(wire::CommandVerb::kCheck, kPulses);
  ASSERT_TRUE(armed.done()) << text_of(armed) << log();
  ASSERT_TRUE(command(wire::CommandVerb::kStart).done()) << log();
  std::map<std::string, wire::PreviewMessage> previews;
  const auto all_cameras_seen = [&] {
    while (auto preview = client_->next_preview(Monotonic::now())) {
      const std::string camera = preview->camera;
      previews[camera] = std::move(*preview);
    }
    return previews.size() == 4;
  };
  EXPECT_TRUE(becomes_true(all_cameras_seen, within(30))) << log();
  for (const auto& [camera, preview] : previews) {
    EXPECT_EQ(preview.size, (ImageSize{160, 120}));
    EXPECT_TRUE(decode_jpeg(preview.jpeg, preview.size)) << camera;
    EXPECT_TRUE(preview.mask) << camera;
  }

  const auto idle_again = [&] {
    const auto health = client_->health(within(5));
    return health.contains("cap01") && health.at("cap01").state == wire::NodeState::kIdle;
  };
  ASSERT_TRUE(becomes_true(idle_again, within(30))) << log();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  const auto account = nlohmann::json::parse(stopped.replies.at("cap01").detail);
  EXPECT_EQ(account["pulses"]["sensed"], kPulses);
  EXPECT_THAT(account["not_ready"], IsEmpty());
  ASSERT_EQ(account["checked"].size(), 4U);
  for (const auto& camera : account["checked"]) {
    EXPECT_EQ(camera["received"], kPulses) << camera;
    EXPECT_THAT(camera["suspect"], IsEmpty()) << camera;
    EXPECT_GT(camera["focus"], 0) << camera;
    EXPECT_GT(camera["foreground"], 0) << "the performer is in the image: " << camera;
  }
  EXPECT_FALSE(std::filesystem::exists(take().folder)) << "nothing is recorded";
}

/// Lamps at 60 Hz mains. Pulses at 9 Hz meet their light of 120 Hz with a beat of 3 Hz. A higher
/// rate leaves a busy machine less time.
class FlickeringStudio : public MonitoredStudio {
 protected:
  FlickeringStudio() : MonitoredStudio({.rate = "9", .simulator = {"--flicker", "0.08@120"}}) {}

  /// The cameras in the report of a check that ends with `status`.
  nlohmann::json check(int status, const std::vector<std::string>& more = {}) {
    std::vector<std::string> line = {"check", "--json", "--pulses", "50"};
    line.insert(line.end(), more.begin(), more.end());
    return nlohmann::json::parse(run_v3dctl(line, status))["cameras"];
  }
};

TEST_F(FlickeringStudio, is_advised_by_the_check_to_use_a_rate_at_which_the_light_is_steady) {
  const nlohmann::json flickering = check(3);
  ASSERT_EQ(flickering.size(), 4U);
  for (const auto& camera : flickering) {
    EXPECT_EQ(camera["verdict"], "bad") << camera;
    EXPECT_NEAR(camera["flicker_amplitude"], 0.08, 0.02) << camera;
    EXPECT_NEAR(camera["beat_hz"], 3, 0.1) << camera;
    ASSERT_TRUE(camera["rate_without_flicker_hz"].is_number()) << camera;
    EXPECT_NEAR(camera["rate_without_flicker_hz"], 120.0 / 13, 1e-6) << camera;
  }
  const nlohmann::json steady = check(0, {"--rate", std::to_string(120.0 / 13)});
  ASSERT_EQ(steady.size(), 4U);
  // The performer who moves changes the brightness, too.
  for (const auto& camera : steady) EXPECT_LT(camera["flicker_amplitude"], 0.01) << camera;
}

TEST_F(MonitoredStudio, records_a_short_take_when_it_is_calibrated_live) {
  calibrate_live();
  for (const auto& entry : std::filesystem::directory_iterator(studio_.storage.takes)) {
    if (entry.path().filename().string().starts_with("calibration-"))
      take_name_ = entry.path().filename();
  }
  const take::TakeInfo info = load_take_info(take());
  EXPECT_THAT(info.name, StartsWith("calibration-"));
  EXPECT_EQ(info.pulses, 5);
  EXPECT_EQ(info.rate_hz, 5);
  EXPECT_EQ(info.state, take::TakeState::kComplete);
}

TEST_F(MonitoredStudio, records_boards_with_an_initial_rig_before_the_first_calibration) {
  std::filesystem::remove(studio_.storage.calib);
  take_name_ = "boards";
  const control::Answer refused = command(wire::CommandVerb::kArm);
  EXPECT_FALSE(refused.done());
  EXPECT_THAT(text_of(refused), HasSubstr("v3dctl calibrate guess makes a first one"));
  const std::vector<std::string> guess = {"calibrate", "guess", "--size",
                                          "160x120",   "--out", studio_.storage.calib.string()};
  run_v3dctl(guess, 0);
  EXPECT_THAT(run_v3dctl(guess, 2),
              HasSubstr("exists already and is not replaced by an uncalibrated rig"));
  calibrate_live();
}

TEST_F(MonitoredStudio, reports_its_machine_and_its_rates_in_health) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "cam01.frames_per_second", 10)) << log();
  EXPECT_TRUE(reaches("cap01", "cpu_daemon_percent", 0));
  EXPECT_GT(value("cap01", "memory_daemon_bytes"), 1e6);
  EXPECT_GT(value("cap01", "disk_seconds_left"), 0) << "also while pulses run";
  EXPECT_EQ(value("cap01", "cam01.streaming_flag"), 1);
  EXPECT_FALSE(client_->health(within(5)).at("cap01").version.empty());
  EXPECT_TRUE(command(wire::CommandVerb::kStop).done()) << log();
}

}  // namespace
}  // namespace v3d
