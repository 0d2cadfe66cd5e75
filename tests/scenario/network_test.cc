// Scenario tests of a network that loses, delays and reorders datagrams: fifteen hosts with one
// camera each, a host for the reconstruction, and the operator's. Every host is a network
// namespace.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/io/file.h"
#include "daemon/control/operator_client.h"
#include "sim/cameras/triggers.h"
#include "support/child_process.h"
#include "support/host_network.h"
#include "support/lossy_switch.h"
#include "support/temporary_folder.h"
#include "take/ledger/verify.h"
#include "trigger/simulated_trigger.h"
#include "wire/messages.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::ChildProcess;
using test::LossySwitch;
using test::within;

constexpr int kCameras = 15;
constexpr size_t kRecon = kCameras;  ///< port of the reconstruction's host
/// A busy machine delivers a first frame within 0.9 periods, or its camera has suspect frames.
constexpr char kRateHz[] = "10";

class StudioOf16 : public testing::Test {
 protected:
  StudioOf16() {
    switch_.emplace(network_.ports(),
                    test::LinkFaults{.loss = 0.02, .max_delay = std::chrono::milliseconds(10)});
    for (int i = 0; i < kCameras; ++i) start_cameras(i);
    connect_trigger();
    for (int i = 0; i < kCameras; ++i) start(node(i), "v3d-captured", static_cast<size_t>(i));
    start("recon01", "v3d-recond", kRecon);
    client_.emplace(load_studio(folder_ / node(0) / "studio.toml"));
  }

  static std::string bin(const std::string& program) {
    return std::string(V3D_BIN) + "/" + program;
  }
  static std::string node(int i) { return "cap" + std::to_string(101 + i).substr(1); }

  ChildProcess& start_at(size_t host, const std::vector<std::string>& command,
                         const std::string& log) {
    std::vector<std::string> all = network_.enter(host);
    all.insert(all.end(), command.begin(), command.end());
    return *processes_.emplace_back(std::make_unique<ChildProcess>(all, folder_ / log));
  }
  /// Every host simulates the cameras of the whole studio on its loopback and uses one of them.
  void start_cameras(int i) {
    const std::filesystem::path folder = folder_ / node(i);
    ChildProcess& simulator = start_at(
        static_cast<size_t>(i),
        {bin("v3d-sim"), "studio", folder, "--cameras", std::to_string(kCameras), "--size", "80x60",
         "--rate", kRateHz, "--loop-frames", "4", "--empty-pulses", "8", "--voxel", "80mm"},
        node(i) + "-sim.log");
    const bool serves = becomes_true(
        [&] { return simulator.output().find("ready\n") != std::string::npos; }, within(60));
    ASSERT_TRUE(serves) << simulator.output();
    if (i == kCameras - 1) write_studio_files();
  }
  /// Writes the studio file into a folder for each node, with its own takes.
  void write_studio_files() {
    std::string text = read_file(folder_ / node(0) / "studio.toml");
    const auto replace = [&](const std::string& from, const std::string& to) {
      const size_t at = text.find(from);
      ASSERT_NE(at, std::string::npos) << from;
      text.replace(at, from.size(), to);
    };
    std::string nodes;
    for (int i = 1; i < kCameras; ++i) nodes += "[[node]]\nname = \"" + node(i) + "\"\n";
    replace("[[node]]\nname = \"recon01\"", nodes + "[[node]]\nname = \"recon01\"");
    replace("ttl=0", "ttl=1");
    replace("wire = \"trigger.sock\"", "wire = \"" + (folder_ / "trigger.sock").string() + "\"");
    replace("key = \"studio.key\"",
            "key = \"" + (folder_ / node(0) / "studio.key").string() + "\"");
    size_t at = 0;
    for (int i = 0; i < kCameras; ++i) {
      at = text.find("[[camera]]\n", at) + 11;
      text.insert(at, "node = \"" + node(i) + "\"\n");
    }
    std::filesystem::create_directory(folder_ / "recon01");
    std::filesystem::copy(folder_ / node(0) / "calib.toml", folder_ / "recon01" / "calib.toml");
    for (int i = 0; i < kCameras; ++i) test::write_text(folder_ / node(i) / "studio.toml", text);
    test::write_text(folder_ / "recon01" / "studio.toml", text);
  }
  /// Connects the trigger's cable to the cameras of all hosts.
  void connect_trigger() {
    for (int i = 0; i < kCameras; ++i) {
      cable_clients_.push_back(
          std::make_unique<trigger::TriggerCableClient>(folder_ / node(i) / "trigger.sock"));
    }
    cable_.emplace(folder_ / "trigger.sock", [this](int64_t, MonotonicInstant at) {
      for (const auto& client : cable_clients_) {
        client->drain();
        client->send({.edge_monotonic_ns = to_ns(at)});
      }
    });
  }
  void start(const std::string& name, const std::string& program, size_t host) {
    start_at(host, {bin(program), "--studio", folder_ / name / "studio.toml", "--node", name},
             name + ".log");
  }

  control::Answer command(wire::CommandVerb verb, const std::string& take = "",
                          int64_t pulses = 0) {
    wire::CommandMessage order;
    order.verb = verb;
    order.take = take;
    order.pulses = pulses;
    return client_->command(order, within(60));
  }
  std::string text_of(const control::Answer& answer) {
    std::string text;
    for (const auto& [name, reply] : answer.replies) text += name + ": " + reply.text + "\n";
    for (const std::string& name : answer.silent) {
      text += name + ": silent\n" + read_file(folder_ / (name + ".log"));
    }
    return text;
  }

  /// By camera: frames for the reconstruction that the switch has dropped until now.
  std::map<std::string, int64_t> injected() const {
    std::map<std::string, int64_t> lost;
    for (const StudioCamera& camera : load_studio(folder_ / node(0) / "studio.toml").cameras) {
      lost[camera.name] = switch_->lost(wire::frame_channel(camera.name), kRecon);
    }
    return lost;
  }
  /// Waits for the end of a train. True when it had all its pulses; a trigger on a busy machine
  /// skips pulses and reports them.
  bool train_has_all(int64_t edges_before) {
    int64_t edges = edges_before;
    MonotonicInstant last_change = Monotonic::now();
    const auto is_over = [&] {
      const MonotonicInstant now = Monotonic::now();
      if (cable_->edges() != edges) last_change = now;
      edges = cable_->edges();
      const bool has_started = edges > edges_before;
      return edges == edges_before + kPulses ||
             (has_started && now - last_change > std::chrono::seconds(2));
    };
    EXPECT_TRUE(becomes_true(is_over, within(30))) << edges - edges_before << " pulses";
    return edges == edges_before + kPulses;
  }
  /// Compares the losses that the nodes report with those that the switch injected since `before`.
  void check_losses(const control::Answer& stopped, const std::map<std::string, int64_t>& before,
                    bool has_all_pulses) {
    const auto recon = nlohmann::json::parse(stopped.replies.at("recon01").detail);
    const auto now = injected();
    for (int i = 0; i < kCameras; ++i) {
      const auto ledger = nlohmann::json::parse(stopped.replies.at(node(i)).detail);
      EXPECT_TRUE(ledger["complete"].get<bool>() || !has_all_pulses)
          << ledger << "\n"
          << read_file(folder_ / (node(i) + ".log"));
      const auto& camera = ledger["cameras"][0];
      const std::string name = camera["name"];
      const auto received = static_cast<int64_t>(recon[name + ".live_received"].get<double>());
      const int64_t lost = now.at(name) - before.at(name);
      EXPECT_EQ(camera["published"].get<int64_t>() - received, lost) << name;
      lost_ += lost;
      late_ += static_cast<int64_t>(recon[name + ".live_late"].get<double>());
    }
    EXPECT_EQ(recon["frames_dropped"], 0);
    incomplete_ += recon["incomplete_sets"].get<int64_t>();
  }
  /// Every node has a complete take on its disk, in spite of lost messages of the trigger's node.
  void check_disks(const std::string& take) {
    for (int i = 0; i < kCameras; ++i) {
      const take::Verification verified = take::verify_take({folder_ / node(i) / take});
      EXPECT_TRUE(verified.whole()) << node(i) << ": " << verified.ledger.verdict();
    }
  }
  void record_takes(int count) {
    const control::Answer learnt = command(wire::CommandVerb::kBackground, "", 8);
    ASSERT_TRUE(learnt.done()) << text_of(learnt);
    for (int i = 0; i < count; ++i) {
      const auto before = injected();
      const int64_t edges = cable_->edges();
      const control::Answer armed =
          command(wire::CommandVerb::kArm, "take-" + std::to_string(i), kPulses);
      ASSERT_TRUE(armed.done()) << "take " << i << "\n" << text_of(armed);
      const control::Answer started = command(wire::CommandVerb::kStart);
      ASSERT_TRUE(started.done()) << "take " << i << "\n" << text_of(started);
      const bool has_all_pulses = train_has_all(edges);
      whole_trains_ += has_all_pulses;
      const control::Answer stopped = command(wire::CommandVerb::kStop);
      ASSERT_TRUE(stopped.done()) << "take " << i << "\n" << text_of(stopped);
      check_losses(stopped, before, has_all_pulses);
      if (has_all_pulses && whole_trains_ == 1) check_disks("take-" + std::to_string(i));
    }
    EXPECT_GT(whole_trains_, count / 2)
        << "this machine does not reach " << kRateHz << " pulses a second";
    EXPECT_GT(lost_, 0);
    EXPECT_GT(incomplete_, 0) << "frame sets without a camera are counted";
    std::printf(
        "%d takes, %d with all pulses, %lld frames lost, %lld overtaken, %lld sets without some "
        "camera\n",
        count, whole_trains_, static_cast<long long>(lost_), static_cast<long long>(late_),
        static_cast<long long>(incomplete_));
  }

  static constexpr int64_t kPulses = 12;

  const test::TemporaryFolder folder_;
  const test::HostNetwork network_{kRecon + 1};
  std::optional<LossySwitch> switch_;
  std::vector<std::unique_ptr<trigger::TriggerCableClient>> cable_clients_;
  std::optional<sim::TriggerCable> cable_;
  std::vector<std::unique_ptr<ChildProcess>> processes_;
  std::optional<control::OperatorClient> client_;
  int whole_trains_ = 0;
  int64_t lost_ = 0;
  int64_t late_ = 0;
  int64_t incomplete_ = 0;
};

TEST_F(StudioOf16, records_takes_on_a_lossy_network_and_counts_every_lost_frame) {
  record_takes(3);
}

TEST_F(StudioOf16, records_a_hundred_takes_on_a_lossy_network_without_a_failed_command) {
  record_takes(100);
}

}  // namespace
}  // namespace v3d
