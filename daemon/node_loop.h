// The loop of a daemon: believed commands in, sealed replies and health out, the watchdog fed, a
// clean end.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "base/studio_file.h"
#include "daemon/bus.h"
#include "daemon/clock_watch.h"
#include "daemon/command_gate.h"
#include "daemon/control.h"
#include "daemon/machine_health.h"
#include "daemon/metrics_server.h"
#include "daemon/node_work.h"
#include "daemon/ptp_watch.h"

namespace v3d {

/// Who a daemon is.
struct NodeIdentity {
  std::string node;
  std::string program;         ///< "v3d-captured"
  std::filesystem::path key;   ///< of the studio
  RealtimeInstant began = {};  ///< when the program began, or later
  std::string metrics;         ///< where health is also served for Prometheus; empty: nowhere
};

/// Without a studio key the node refuses every command, and says in its log and its health how to
/// make one; it looks for it once a second.
class NodeLoop {
 public:
  /// `work` and `bus` outlive the loop.
  NodeLoop(NodeIdentity identity, Bus& bus, NodeWork& work);

  /// A take that the daemon was at when it ended before (Controller::remember).
  void remember(const std::string& take, const std::string& text, const std::string& detail) {
    controller_.remember(take, text, detail);
  }

  /// Runs until stop_requested(), then closes what is open: a take that is being recorded is
  /// drained for at most kLastDrain and left valid.
  void run();

 private:
  void turn();
  MonotonicInstant next_turn() const;
  void carry_out(const Controller::Step& step);
  void begin(Work work);
  void publish(std::vector<ReplyMessage> replies);
  void publish_health();
  void report_commands(HealthMessage& health) const;
  void look_for_key();
  void let_go_what_nobody_confirms();
  void rejoin_running_take();
  void feed_watchdog();
  void shut_down();

  static constexpr Duration kTurn = std::chrono::milliseconds(20);
  /// When nothing goes on. A command ends the wait at once.
  static constexpr Duration kIdleTurn = std::chrono::milliseconds(200);
  static constexpr Duration kHealthEvery = std::chrono::seconds(1);
  /// Ready for so long: whoever asked is gone, or would not wait for the slowest node either.
  static constexpr Duration kConfirmWithin = std::chrono::seconds(60);
  static constexpr Duration kLastDrain = std::chrono::seconds(5);

  const NodeIdentity me_;
  Bus& bus_;
  NodeWork& work_;
  Controller controller_;
  CommandGate gate_;
  std::optional<StudioKey> key_;
  std::string no_key_;  ///< why there is none
  Subscription<CommandMessage> commands_;
  MachineHealth machine_;
  ClockWatch clock_;
  PtpWatch ptp_;
  const std::unique_ptr<MetricsServer> metrics_;  ///< or null
  int64_t health_seq_ = 0;
  Phase told_phase_ = Phase::kIdle;  ///< by the last health message
  MonotonicInstant next_health_;
  MonotonicInstant ready_since_;  ///< while nobody has confirmed
  std::optional<Duration> watchdog_;
  MonotonicInstant last_fed_;
};

}  // namespace v3d
