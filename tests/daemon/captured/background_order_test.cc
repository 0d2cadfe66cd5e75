// ActiveTake that learns the background of the cameras of its node.
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <optional>
#include <string>

#include "base/core/error.h"
#include "capture/fed_camera.h"
#include "daemon/captured/active_take.h"
#include "support/child_process.h"
#include "support/temporary_folder.h"

namespace v3d::captured {
namespace {

using test::becomes_true;
using test::within;

/// A camera that sends no frames, and that a test can unplug.
class PluggedCamera : public capture::FedCamera {
 public:
  explicit PluggedCamera(const std::atomic<bool>& is_plugged)
      : FedCamera(std::make_shared<capture::FrameSource>()), is_plugged_(is_plugged) {}
  void start() override {
    if (!is_plugged_) throw InputError("camera cam07: no answer");
  }
  bool lost() const override { return !is_plugged_; }

 private:
  const std::atomic<bool>& is_plugged_;
};

class BackgroundOrder : public testing::Test {
 protected:
  Studio studio() const {
    Studio studio;
    studio.name = "dojo";
    studio.nodes = {{"cap01"}, {"cap02"}};
    studio.trigger.node = "cap01";
    studio.storage.background = folder_ / "background";
    StudioCamera& camera = studio.cameras.emplace_back();
    camera.name = "cam07";
    camera.node = "cap02";
    return studio;
  }
  static ActiveTake::Plan plan() {
    wire::CommandMessage order;
    order.verb = wire::CommandVerb::kBackground;
    return {.order = order,
            .train = {.rate_hz = 10, .width = std::chrono::milliseconds(1), .count = 4}};
  }
  std::unique_ptr<ActiveTake> begin() {
    return ActiveTake::begin({{studio_, "cap02", bus_, cameras_, slots_, signer_},
                              trigger_,
                              [](const capture::PulseEdge&) {}},
                             plan());
  }
  bool camera_becomes(capture::CameraState state) const {
    return becomes_true([&] { return (*cameras_.begin())->status().state == state; }, within(30));
  }

  std::atomic<bool> is_plugged_ = true;
  const test::TemporaryFolder folder_;
  const Studio studio_ = studio();
  bus::Bus bus_{"udpm://239.255.76.67:7667?ttl=0"};
  NodeTrigger trigger_{studio_, "cap02", bus_};
  NodeCameras cameras_{studio_, "cap02", [this](const StudioCamera&) {
                         return std::make_unique<PluggedCamera>(is_plugged_);
                       }};
  PrioritySemaphore slots_{1};
  std::shared_ptr<const take::TakeSigner> signer_;
};

TEST_F(BackgroundOrder, fails_for_a_camera_that_is_lost_between_ready_and_the_first_pulse) {
  cameras_.arm(std::chrono::milliseconds(100), trigger_.reports_edges());
  ASSERT_TRUE(camera_becomes(capture::CameraState::kReady));
  const auto take = begin();
  is_plugged_ = false;
  ASSERT_TRUE(camera_becomes(capture::CameraState::kLost));
  take->start();
  take->train_ended();
  std::optional<BackgroundLearner::Result> result;
  ASSERT_TRUE(becomes_true(
      [&] {
        result = take->background_result();
        return result.has_value();
      },
      within(30)));
  EXPECT_FALSE(result->succeeded);
  EXPECT_EQ(result->text, "cam07: only 0 of 4 plates arrived");
}

}  // namespace
}  // namespace v3d::captured
