// Scenario tests of all known attacks, in turn and at a stated rate, during a take: the take is
// complete, the trigger's node accepts a stop within 2 s, and memory growth and processor time are
// bounded. A studio of two nodes also has clock steps and a second process with the name of the
// trigger's node. V3D_ATTACK_RATE=50000 sends that many datagrams a second instead of 2,000.
// docs/security.md publishes the printed figures.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdio>
#include <vector>

#include "attacker.h"
#include "set_clock.h"
#include "support/process_meter.h"
#include "take/ledger/verify.h"
#include "viewed_studio.h"

namespace v3d {
namespace {

using namespace std::chrono_literals;
using test::Attack;
using test::Attacker;
using test::becomes_true;
using test::ChildProcess;
using test::ViewedStudio;
using test::within;

constexpr int kPulses = 50;
/// Lower bound of the meshes in the take without attacks. They give the processor time of a mesh.
constexpr double kMinMeshes = 25;
/// Upper bound of the growth of one process, kB.
constexpr double kMaxGrowthKb = 16 * 1024;
/// Upper bound of the time until the trigger's node has accepted a stop, which ends the pulses, s.
constexpr double kMaxStopS = 2;
/// Upper bound of the processor time of the three daemons for one attack datagram, microseconds.
/// Several times what an idle machine needs.
constexpr double kMaxProcessorUs = 250;

class HostileNetwork : public ViewedStudio {
 protected:
  explicit HostileNetwork(const test::Studio4Options& options = {})
      : ViewedStudio("", at_live_quality_and_5_hz(options)) {
    // A take whose file is a FIFO.
    std::filesystem::create_directories(folder_ / "trap");
    mkfifo((folder_ / "trap/take.toml").c_str(), 0666);
  }

  /// At live quality, the processor time of a mesh does not depend on the load of the machine. At
  /// 5 Hz, a busy machine records whole takes.
  static test::Studio4Options at_live_quality_and_5_hz(test::Studio4Options options) {
    options.more += "quality = \"live\"\n";
    options.rate = "5";
    return options;
  }

  /// Resources that the daemons used while a take was recorded.
  struct Cost {
    double seconds = 0;
    double processor_s = 0;  ///< of all daemons
    double recon_s = 0;      ///< processor time of v3d-recond
    double meshes = 0;
    double growth_kb = 0;  ///< growth of the process that grew most
    int64_t attacks = 0;
  };

  std::vector<ChildProcess*> daemons() {
    std::vector<ChildProcess*> all = {&*captured_, &*recond_, &*viewd_};
    if (second_captured_) all.push_back(&*second_captured_);
    return all;
  }

  /// Called once in the take that is attacked, when all nodes record.
  virtual void disturb() {}

  /// Records a take of kPulses pulses and returns its cost. Fails the test when it is incomplete.
  Cost record(const std::string& name, const Attacker* attacker = nullptr) {
    take_name_ = name;
    arm_and_start(0);
    std::vector<test::ProcessSample> before;
    for (const ChildProcess* daemon : daemons()) before.push_back(test::sample(daemon->pid()));
    const int64_t sent = attacker != nullptr ? attacker->sent() : 0;
    const MonotonicInstant start = Monotonic::now();
    if (attacker != nullptr) disturb();
    const int cameras = second_captured_ ? 2 : 4;
    EXPECT_TRUE(reaches("cap01", "frames_written", cameras * kPulses)) << log();
    if (attacker == nullptr) {
      EXPECT_TRUE(reaches("recon01", "meshes", kMinMeshes)) << log();
    }
    Cost cost{.seconds = to_seconds(Monotonic::now() - start)};
    cost.meshes = value("recon01", "meshes");
    if (attacker != nullptr) cost.attacks = attacker->sent() - sent;
    for (size_t i = 0; i < before.size(); ++i) {
      const test::ProcessSample now = test::sample(daemons()[i]->pid());
      const double used_s = now.processor_s - before[i].processor_s;
      cost.processor_s += used_s;
      if (daemons()[i] == &*recond_) cost.recon_s = used_s;
      cost.growth_kb = std::max(cost.growth_kb, now.resident_kb - before[i].resident_kb);
    }
    const MonotonicInstant stop_sent = Monotonic::now();
    std::optional<double> accepted_s;
    wire::CommandMessage stop;
    stop.verb = wire::CommandVerb::kStop;
    stop.take = take_name_;
    const auto on_reply = [&](const wire::ReplyMessage& reply) {
      if (reply.node != "cap01" || accepted_s) return;
      accepted_s = to_seconds(Monotonic::now() - stop_sent);
    };
    const control::Answer stopped = client_->command(stop, within(60), on_reply);
    const double stop_s = to_seconds(Monotonic::now() - stop_sent);
    EXPECT_TRUE(stopped.done()) << text_of(stopped) << log();
    // The reconstruction drains for more than a second afterwards, or longer on a busy machine.
    EXPECT_THAT(accepted_s, testing::Optional(testing::Lt(kMaxStopS)));
    std::printf("%s: stop was accepted in %.2f s and executed in %.2f s\n", name.c_str(),
                accepted_s.value_or(-1), stop_s);
    std::vector<take::TakePaths> parts = {take()};
    if (second_captured_) parts.push_back(take_of_cap02());
    for (const take::TakePaths& part : parts) {
      const take::Verification found = verify_take(part);
      EXPECT_TRUE(found.whole()) << part.folder << ": " << found.ledger.verdict() << "\n"
                                 << rejections("cap02") << log();
    }
    return cost;
  }
  /// The counts of rejected datagrams and messages of a node, a line each.
  std::string rejections(const std::string& node) {
    std::string text;
    const auto health = client_->health(within(5));
    if (!health.contains(node)) return text;
    for (const auto& [name, count] : health.at(node).values) {
      if (name.starts_with("datagrams_") || name.starts_with("messages_")) {
        text += node + " " + name + " " + std::to_string(static_cast<int64_t>(count)) + "\n";
      }
    }
    return text;
  }

  /// Records a take without and one with attacks.
  void expect_no_harm();
  /// The attacks continue meanwhile, so the count is reached at any rate, also where the kernel
  /// drops a part of the datagrams.
  void expect_rejected(const std::string& cause) {
    EXPECT_TRUE(reaches("cap01", cause, 50)) << cause;
    std::printf("  %-20s %6.0f rejected by cap01\n", cause.c_str(), value("cap01", cause));
  }

  int metrics_port_ = 0;  ///< of cap01; 0: it serves none
};

void HostileNetwork::expect_no_harm() {
  const Cost quiet = record("kendo-07");
  Attacker attacker(studio_.network.lcm_url, {.viewd = port_, .metrics = metrics_port_});
  ASSERT_TRUE(becomes_true([&] { return attacker.sent() >= 2 * Attacker::kLongOnes; }, within(60)));
  const Cost attacked = record("kendo-08", &attacker);
  for (const char* cause : {"datagrams_malformed", "datagrams_foreign", "datagrams_oversized",
                            "messages_forged", "messages_replayed"}) {
    expect_rejected(cause);
  }
  std::printf("  %-20s %6.0f before cap01\n", "dropped by kernel",
              value("cap01", "datagrams_dropped_by_kernel"));
  attacker.stop();

  for (size_t i = 0; i < test::kAttackNames.size(); ++i) {
    std::printf("  %-34s %6lld sent\n", test::kAttackNames[i],
                static_cast<long long>(attacker.sent(static_cast<Attack>(i))));
  }
  const auto sent = static_cast<double>(attacked.attacks);
  const double of_a_core = attacked.processor_s / attacked.seconds;
  // Without attacks, this take would use as much for each second, and for each mesh.
  ASSERT_GT(quiet.meshes, 0);
  const double others_s = (quiet.processor_s - quiet.recon_s) / quiet.seconds * attacked.seconds;
  const double recon_s = quiet.recon_s / quiet.meshes * attacked.meshes;
  const double us_each = 1e6 * (attacked.processor_s - others_s - recon_s) / sent;
  std::printf(
      "  %.0f datagrams a second, %lld half-open connections; the daemons used %.2f of a "
      "core (%.2f without attack), %.0f us a datagram; the largest grew by %.0f KiB\n",
      sent / attacked.seconds, static_cast<long long>(attacker.connections()), of_a_core,
      quiet.processor_s / quiet.seconds, us_each, attacked.growth_kb);
  for (ChildProcess* daemon : daemons()) EXPECT_TRUE(daemon->runs()) << log();
  EXPECT_LT(attacked.growth_kb, kMaxGrowthKb);
  EXPECT_LT(us_each, kMaxProcessorUs);
  EXPECT_TRUE(get("/index.html")->receives("200 OK")) << "v3d-viewd still serves browsers";
  EXPECT_TRUE(get("/api/takes")->receives("kendo-08")) << "beside a FIFO";
}

TEST_F(HostileNetwork, harms_no_take_and_causes_bounded_memory_growth) { expect_no_harm(); }

class HostileNetworkOfMembers : public HostileNetwork {
 protected:
  HostileNetworkOfMembers() : HostileNetwork({.has_members = true}) {}
};

TEST_F(HostileNetworkOfMembers, harms_no_take_and_causes_bounded_memory_growth) {
  expect_no_harm();
}

constexpr int kMetricsPort = 9464;

/// The clocks of both nodes are set back, a second process has the name of the trigger's node, and
/// the places of the metrics of cap01 are taken.
class HostileStudioOfTwoNodes : protected test::SetClockPreloaded, public HostileNetwork {
 protected:
  HostileStudioOfTwoNodes()
      : HostileNetwork({.network = "metrics = \"127.0.0.1:" + std::to_string(kMetricsPort) + "\"\n",
                        .two_nodes = true}) {
    metrics_port_ = kMetricsPort;
  }

  void disturb() override {
    set_clock(-60);
    EXPECT_TRUE(reaches("cap02", "clock_steps", 1)) << log();
    start_duplicate();
    EXPECT_TRUE(raises_alarm()) << log();
    EXPECT_TRUE(duplicate_knows()) << duplicate_->output();
    set_clock(3600);
    EXPECT_TRUE(reaches("cap02", "clock_steps", 2)) << log();
  }
};

TEST_F(HostileStudioOfTwoNodes, harms_no_take_and_causes_bounded_memory_growth) {
  expect_no_harm();
}

}  // namespace
}  // namespace v3d
