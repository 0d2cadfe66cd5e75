// A reconstruction node whose disk fails when it closes the mesh file, and one that restarts while
// a take is armed.
#include "daemon/recond/recon_node.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>

#include "base/core/error.h"
#include "support/child_process.h"
#include "support/fsync_hook.h"
#include "support/temporary_folder.h"
#include "take/logs/mesh_file.h"
#include "wire/messages.h"

namespace v3d::recond {
namespace {

using testing::StartsWith;

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";
constexpr char kCalib[] = R"([cam_0]
name = "cam01"
size = [64, 48]
matrix = [[50.0, 0.0, 32.0], [0.0, 50.0, 24.0], [0.0, 0.0, 1.0]]
distortions = [0.0, 0.0, 0.0, 0.0]
rotation = [0.0, 0.0, 0.0]
translation = [0.0, 0.0, 2.0]
)";

class ReconNodeOnBadDisk : public testing::Test {
 protected:
  Studio studio() const {
    Studio studio;
    studio.nodes = {{"cap01"}, {"recon01"}};
    studio.trigger.node = "cap01";
    studio.cameras.resize(1);
    studio.cameras[0].name = "cam01";
    studio.cameras[0].node = "cap01";
    studio.space.bounds = {{-0.4, -0.4, -0.4}, {0.4, 0.4, 0.4}};
    studio.reconstruction.nodes = {"recon01"};
    studio.reconstruction.voxel_m = 0.1;
    studio.reconstruction.min_views = 1;
    studio.storage.takes = folder_ / "takes";
    studio.storage.calib = folder_ / "calib.toml";
    test::write_text(studio.storage.calib, kCalib);
    return studio;
  }
  static wire::CommandMessage order() {
    wire::CommandMessage order;
    order.verb = wire::CommandVerb::kArm;
    order.take = "kendo-07";
    return order;
  }
  std::string expected_error() const {
    return "cannot sync " + (folder_ / "takes/kendo-07/mesh.v3d").string() + ": Input/output error";
  }

  const test::TemporaryFolder folder_;
  const Studio studio_ = studio();
  bus::Bus bus_{kUrl};
  bus::Subscription<wire::EventMessage> events_{bus_, wire::kEventChannel, 16};
  test::FsyncHook hook_;
  ReconNode node_{studio_, "recon01", bus_};
};

TEST_F(ReconNodeOnBadDisk, reports_path_and_cause_in_its_reply_and_in_an_event) {
  node_.arm(order());
  hook_.fail_next(EIO);
  node_.drain();
  std::optional<control::NodeReport> report;
  ASSERT_TRUE(test::becomes_true(
      [&] {
        report = node_.poll(control::Phase::kDraining);
        return report.has_value();
      },
      test::within(30)));
  EXPECT_EQ(report->event, control::Input::kBroken);
  EXPECT_EQ(report->text, expected_error());
  node_.disarm();
  const auto event = events_.wait(Monotonic::now() + std::chrono::seconds(10));
  ASSERT_TRUE(event);
  EXPECT_EQ(event->severity, wire::Severity::kAlarm);
  EXPECT_THAT(event->text, StartsWith(expected_error()));
}

TEST_F(ReconNodeOnBadDisk, reports_path_and_cause_in_an_event_when_it_is_disarmed_without_a_drain) {
  node_.arm(order());
  hook_.fail_next(EIO);
  node_.disarm();
  const auto event = events_.wait(Monotonic::now() + std::chrono::seconds(10));
  ASSERT_TRUE(event);
  EXPECT_THAT(event->text, StartsWith(expected_error()));
}

using ReconNodeAfterRestart = ReconNodeOnBadDisk;

TEST_F(ReconNodeAfterRestart, arms_a_take_again_that_was_armed_without_a_mesh) {
  const std::filesystem::path mesh = folder_ / "takes/kendo-07/mesh.v3d";
  std::filesystem::create_directories(mesh.parent_path());
  io::throw_if_failed(take::MeshFileWriter(mesh).close());  // as a daemon that is stopped leaves it
  EXPECT_NO_THROW(node_.arm(order()));
}

TEST_F(ReconNodeAfterRestart, refuses_to_arm_a_take_with_a_mesh) {
  const std::filesystem::path mesh = folder_ / "takes/kendo-07/mesh.v3d";
  std::filesystem::create_directories(mesh.parent_path());
  take::MeshFileWriter file(mesh);
  io::throw_if_failed(file.append(0, std::vector<uint8_t>{1}));
  io::throw_if_failed(file.close());
  EXPECT_THROW(node_.arm(order()), InputError);
  EXPECT_EQ(take::MeshFileReader(mesh).pulses().size(), 1U);
}

}  // namespace
}  // namespace v3d::recond
