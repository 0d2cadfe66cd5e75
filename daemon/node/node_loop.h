// The loop of a daemon: believed commands in, sealed replies and health out, the watchdog fed, a
// clean end.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/studio_file.h"
#include "daemon/bus/bus.h"
#include "daemon/bus/credential_files.h"
#include "daemon/control/clock_monitor.h"
#include "daemon/control/command_gate.h"
#include "daemon/control/node_delegate.h"
#include "daemon/control/node_protocol.h"
#include "daemon/control/ptp_monitor.h"
#include "daemon/node/machine_health.h"
#include "daemon/node/metrics_server.h"
#include "daemon/node/name_monitor.h"

namespace v3d {

/// Who a daemon is.
struct NodeIdentity {
  std::string node;
  std::string program;  ///< "v3d-captured"
  CredentialPaths credentials;
  std::string metrics;  ///< where health is also served for Prometheus; empty: nowhere
};

/// Without a studio key, or without the member list and the signing key that the studio file names,
/// the node rejects every command, and reports in its log and its health how to make them. It reads
/// their files once a second, so they are made or replaced without a restart.
class NodeLoop {
 public:
  /// `work` and `bus` outlive the loop.
  NodeLoop(NodeIdentity identity, Bus& bus, NodeDelegate& work);

  /// A take that the daemon was at when it ended before (Controller::remember).
  void remember(const std::string& take, const std::string& text, const std::string& detail) {
    protocol_.remember(take, text, detail);
  }

  /// Runs until stop_requested(), then closes what is open: a take that is being recorded is
  /// drained for at most kLastDrain and left valid.
  void run();
  /// One round of run(): at most one command, and what is due.
  void turn();

 private:
  void on_command(const CommandGate::Admitted& admitted);
  bool is_refused_for_name(const CommandMessage& command);
  void watch_name(HealthMessage& health);
  MonotonicInstant next_turn() const;
  void publish(ReplyMessage reply);
  void publish_health();
  void follow_clock(HealthMessage& health);
  void report_commands(HealthMessage& health) const;
  void read_credentials();
  std::string credential_problem() const;
  void feed_watchdog();
  void shut_down();

  const NodeIdentity me_;
  Bus& bus_;
  NodeDelegate& work_;
  NodeProtocol protocol_;
  CommandGate gate_;
  CredentialFiles files_;
  Subscription<CommandGate::Admitted> commands_;
  NameMonitor name_monitor_;
  std::string name_alarm_;  ///< empty: no other process has this node's name
  int64_t clock_steps_ = 0;
  Duration told_step_{};
  MachineHealth machine_;
  ClockMonitor clock_;
  PtpMonitor ptp_;
  const std::unique_ptr<MetricsServer> metrics_;  ///< or null
  std::optional<Duration> watchdog_;
  MonotonicInstant last_fed_;
};

}  // namespace v3d
