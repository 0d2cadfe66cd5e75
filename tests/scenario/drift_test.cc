// Scenario test of the displacement monitor: it reports a displaced camera while a take is
// recorded.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/config/calib_file.h"
#include "daemon/bus/bus.h"
#include "studio4.h"
#include "wire/messages.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::within;
using testing::HasSubstr;

constexpr double kShiftPx = 4;

/// Twelve cameras: enough to identify the one that does not fit.
class Studio12 : public test::Studio4 {
 protected:
  Studio12() : Studio4({.cameras = 12, .rate = "10"}), bus_(studio_.network.lcm_url) {}
  void SetUp() override { events_.emplace(bus_, wire::kEventChannel, 1024); }

  /// Shifts the principal point of cam03 in the rig file, as if its image had moved to the left
  /// since the calibration.
  void displace_camera() const {
    Rig rig = load_calib(studio_.storage.calib);
    CameraModel& model = rig.at(static_cast<size_t>(find_camera(rig, "cam03"))).model;
    Eigen::Matrix3d matrix = model.matrix();
    matrix(0, 2) += kShiftPx;
    model = CameraModel(model.size(), matrix, model.distortion(), model.cam_from_world());
    save_calib(studio_.storage.calib, rig);
  }

  /// Waits until the monitor has measured a displacement of cam03, in pixels. A result needs ten
  /// seconds of processor time, of which a machine with ten busy processes for each processor gives
  /// it little. False at timeout.
  bool measures(double wanted_px) {
    return becomes_true([&] { return value("recon01", "cam03.drift_px") >= wanted_px; },
                        within(400));
  }
  /// Events about displaced cameras since the last call.
  std::vector<wire::EventMessage> displacement_events() {
    std::vector<wire::EventMessage> found;
    while (auto event = events_->wait(Monotonic::now())) {
      if (event->text.find("displaced") != std::string::npos) found.push_back(*std::move(event));
    }
    return found;
  }

  bus::Bus bus_;
  std::optional<bus::Subscription<wire::EventMessage>> events_;
};

TEST_F(Studio12, reports_the_displaced_camera_alone_and_no_camera_before) {
  arm_and_start(0);
  ASSERT_TRUE(measures(0)) << log();
  ASSERT_TRUE(command(wire::CommandVerb::kStop).done()) << log();
  EXPECT_THAT(displacement_events(), testing::IsEmpty()) << log();

  displace_camera();
  take_name_ = "kendo-08";
  arm_and_start(0);
  ASSERT_TRUE(measures(kShiftPx / 2)) << log();
  std::vector<wire::EventMessage> events;
  EXPECT_TRUE(becomes_true(
      [&] {
        events = displacement_events();
        return !events.empty();
      },
      within(30)))
      << log();
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events[0].subject, "cam03");
  EXPECT_EQ(events[0].severity, wire::Severity::kAlarm);
  EXPECT_THAT(events[0].text, HasSubstr("are shifted by"));
  EXPECT_THAT(events[0].text, HasSubstr("calibrate it again"));
  EXPECT_NEAR(value("recon01", "cam03.drift_px"), kShiftPx, 1.5);
  ASSERT_TRUE(command(wire::CommandVerb::kStop).done()) << log();
}

}  // namespace
}  // namespace v3d
