// A capture node with the trigger and no camera that works: it triggers cameras of other nodes.
#include "daemon/captured/capture_node.h"

#include <gtest/gtest.h>

#include "base/config/calib_file.h"
#include "base/io/file.h"
#include "daemon/node/take_folder.h"
#include "support/child_process.h"
#include "support/studio_text.h"
#include "support/temporary_folder.h"
#include "take/ledger/take_signature.h"
#include "trigger/cable_server.h"

namespace v3d::captured {
namespace {

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";
constexpr int64_t kPulses = 4;

class TriggerOnlyNode : public testing::Test {
 protected:
  /// `unplugged`: names of cameras that cannot be opened.
  explicit TriggerOnlyNode(const std::vector<std::string>& unplugged = {})
      : studio_(studio(unplugged)) {}

  Studio studio(const std::vector<std::string>& unplugged) const {
    Studio studio;
    studio.name = "dojo";
    studio.path = folder_ / "studio.toml";
    test::write_text(studio.path, test::studio_text({{"cap01", {}}, {"cap02", {"cam01"}}}));
    studio.nodes = {{"cap01"}};
    studio.trigger.node = "cap01";
    studio.trigger.wire = cable_.path();
    studio.trigger.rate_hz = 5;
    studio.storage.takes = folder_ / "takes";
    studio.storage.background = folder_ / "background";
    studio.storage.calib = folder_ / "calib.toml";
    const Eigen::Matrix3d intrinsics = Eigen::Vector3d(600, 600, 1).asDiagonal();
    save_calib(studio.storage.calib,
               {RigCamera{.name = "cam01", .model = {{640, 480}, intrinsics, {}, {}}}});
    std::filesystem::create_directories(studio.storage.takes);
    std::filesystem::create_directories(studio.storage.background);
    for (const std::string& name : unplugged) {
      StudioCamera& camera = studio.cameras.emplace_back();
      camera.name = name;
      camera.node = "cap01";
      camera.kind = CameraKind::kV4l2;
      camera.address = folder_ / "unplugged";
    }
    return studio;
  }
  static wire::CommandMessage order(wire::CommandVerb verb) {
    wire::CommandMessage order;
    order.sender = "ada@pc";
    order.verb = verb;
    order.take = name(verb);
    order.pulses = kPulses;
    return order;
  }
  /// The report of the node in this phase.
  control::NodeReport report(control::Phase phase) {
    std::optional<control::NodeReport> report;
    EXPECT_TRUE(test::becomes_true(
        [&] {
          report = node_.poll(phase);
          return report.has_value();
        },
        test::within(30)));
    return report.value_or(control::NodeReport{});
  }
  void start_take(const std::string& take) {
    wire::CommandMessage arm = order(wire::CommandVerb::kArm);
    arm.take = take;
    node_.arm(arm);
    ASSERT_EQ(report(control::Phase::kArming).event, control::Input::kReady);
    node_.start();
  }
  void finish_take() {
    EXPECT_EQ(report(control::Phase::kRecording).event, control::Input::kTrainEnded);
    node_.drain();
    EXPECT_EQ(report(control::Phase::kDraining).event, control::Input::kDrained);
    node_.disarm();
  }
  wire::PublicKey key_of_signature(const std::string& take) const {
    const auto path = signature_path(node::take_paths(studio_, take), "cap01");
    return take::parse_signature(read_file(path), path).key;
  }
  double pulses_commanded() {
    wire::HealthMessage health;
    node_.report_health(health);
    return health.values.at("pulses_commanded");
  }

  const test::TemporaryFolder folder_;
  trigger::CableServer cable_;
  const Studio studio_;
  bus::Bus bus_{kUrl};
  CaptureNode node_{studio_, "cap01", bus_};
};

TEST_F(TriggerOnlyNode, has_no_problem_before_its_first_order_opens_the_sense_line) {
  wire::HealthMessage health;
  node_.report_health(health);
  EXPECT_EQ(health.text, "");
}

TEST_F(TriggerOnlyNode, has_learnt_the_background_when_the_pulses_have_ended) {
  const auto learns_from_all_pulses = [&] {  // a busy host may skip some
    const size_t before = cable_.edges().size();
    node_.learn(order(wire::CommandVerb::kBackground));
    EXPECT_EQ(report(control::Phase::kArming).event, control::Input::kReady);
    node_.start();
    EXPECT_EQ(report(control::Phase::kLearning).event, control::Input::kReady);
    node_.disarm();
    return cable_.wait_for_edges(before + kPulses);
  };
  EXPECT_TRUE(test::becomes_true(learns_from_all_pulses, test::within(60)));
}

TEST_F(TriggerOnlyNode, fires_every_pulse_of_a_check) {
  node_.arm(order(wire::CommandVerb::kCheck));
  ASSERT_EQ(report(control::Phase::kArming).event, control::Input::kReady);
  node_.start();
  EXPECT_EQ(report(control::Phase::kRecording).text, "pulses have ended");
  node_.drain();
  EXPECT_EQ(report(control::Phase::kDraining).text, "checked 0 cameras");
  EXPECT_EQ(pulses_commanded(), kPulses);
}

TEST_F(TriggerOnlyNode, has_pulse_0_at_its_start_after_interference_on_the_sense_line) {
  wire::CommandMessage arm = order(wire::CommandVerb::kArm);
  arm.take = "kendo-04";
  node_.arm(arm);
  ASSERT_EQ(report(control::Phase::kArming).event, control::Input::kReady);
  ASSERT_TRUE(cable_.wait_for_clients(2)) << "generator and sense line";
  const TriggerEdge spike{to_ns(Monotonic::now() - std::chrono::seconds(10))};
  cable_.send_to_all({reinterpret_cast<const char*>(&spike), sizeof spike});
  node_.start();
  finish_take();
  const take::Ledger ledger = take::load_ledger(node::take_paths(studio_, arm.take).ledger());
  EXPECT_EQ(ledger.extra, 1);
  EXPECT_EQ(ledger.commanded, kPulses);
  // Pulses that a busy host did not send in time are listed as not sensed.
  EXPECT_EQ(ledger.sensed.value_or(0) + std::ssize(ledger.unsensed), kPulses);
  EXPECT_GT(ledger.sensed.value_or(0), 0);
  EXPECT_EQ(ledger.sensed.value_or(0), std::ssize(cable_.edges())) << "without the interference";
}

TEST_F(TriggerOnlyNode, signs_a_take_with_the_key_that_it_had_when_the_take_was_armed) {
  const wire::SigningKey first = wire::SigningKey::make(), second = wire::SigningKey::make();
  start_take("kendo-01");
  node_.set_signing_key(first);
  finish_take();
  EXPECT_FALSE(
      std::filesystem::exists(signature_path(node::take_paths(studio_, "kendo-01"), "cap01")))
      << "it was armed without a key";
  start_take("kendo-02");
  node_.set_signing_key(second);
  finish_take();
  EXPECT_EQ(key_of_signature("kendo-02"), first.public_key());
  start_take("kendo-03");
  finish_take();
  EXPECT_EQ(key_of_signature("kendo-03"), second.public_key());
}

class NodeWithoutItsCamera : public TriggerOnlyNode {
 protected:
  NodeWithoutItsCamera() : TriggerOnlyNode({"cam01"}) {}
};

TEST_F(NodeWithoutItsCamera, lacks_no_frames_in_a_take_that_goes_without_the_camera) {
  wire::CommandMessage arm = order(wire::CommandVerb::kArm);
  arm.allow_missing = {"cam01"};
  arm.pulses = 8;  // a frame may be five periods late
  node_.arm(arm);
  ASSERT_EQ(report(control::Phase::kArming).event, control::Input::kReady);
  node_.start();
  EXPECT_EQ(report(control::Phase::kRecording).event, control::Input::kTrainEnded);
  wire::HealthMessage health;
  node_.report_health(health);
  EXPECT_EQ(health.values.at("pulses_commanded"), 8);
  EXPECT_EQ(health.values.at("frames_missing"), 0);
  EXPECT_EQ(health.values.at("cam01.frames_missing"), 0);
  EXPECT_EQ(health.values.at("cam01.streaming_flag"), 0) << "it is still reported as absent";
}

}  // namespace
}  // namespace v3d::captured
