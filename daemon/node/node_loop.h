// Main loop of a node's daemon: executes authenticated commands, sends replies and health, feeds
// the watchdog, and shuts down in order.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/config/studio_file.h"
#include "daemon/bus/bus.h"
#include "daemon/bus/credential_files.h"
#include "daemon/control/clock_monitor.h"
#include "daemon/control/command_replay_filter.h"
#include "daemon/control/node_delegate.h"
#include "daemon/control/node_protocol.h"
#include "daemon/control/ptp_monitor.h"
#include "daemon/node/machine_health.h"
#include "daemon/node/metrics_server.h"
#include "daemon/node/name_monitor.h"

namespace v3d {

/// Identity of a daemon.
struct NodeIdentity {
  std::string node;
  std::string program;  ///< "v3d-captured"
  CredentialPaths credentials;
  std::string metrics;  ///< address of the Prometheus server; empty: none
};

/// Without a studio key, or without the member list and the signing key that the studio file names,
/// the node rejects every command; its log and its health explain how to create them. It reads
/// their files once a second, so they can be created or replaced without a restart, and passes the
/// signing key on to the delegate. One thread.
class NodeLoop {
 public:
  /// `delegate` and `bus` outlive the loop.
  NodeLoop(NodeIdentity identity, Bus& bus, NodeDelegate& delegate);

  /// Result of a take that was active when the daemon ended (see Controller::remember).
  void remember(const std::string& take, const std::string& text, const std::string& detail) {
    protocol_.remember(take, text, detail);
  }

  /// Runs until stop_requested(). Then drains an active take, for at most kLastDrain, and closes it
  /// in a valid state.
  void run();
  /// One iteration of run(): executes at most one command, and everything that is due.
  void run_once();

 private:
  void on_command(const CommandReplayFilter::Admitted& admitted);
  bool may_mean_duplicate(const CommandMessage& command) const;
  bool reject_for_duplicate_name(const CommandMessage& command);
  void check_name(HealthMessage& health);
  MonotonicInstant next_deadline() const;
  void publish(ReplyMessage reply);
  void publish_health();
  void check_clock(HealthMessage& health);
  /// Counters of commands, messages and datagrams.
  void report_counts(HealthMessage& health) const;
  /// If the text of `health` is empty, sets it to the problem of the credentials or messages.
  void report_problem(HealthMessage& health) const;
  void read_credentials();
  void pass_on_signing_key();
  std::string credential_problem() const;
  void feed_watchdog();
  void shut_down();

  const NodeIdentity identity_;
  Bus& bus_;
  NodeDelegate& delegate_;
  NodeProtocol protocol_;
  CommandReplayFilter filter_;
  CredentialFiles files_;
  std::optional<PublicKey> passed_key_;  ///< of the signing key that the delegate has
  Subscription<CommandReplayFilter::Admitted> commands_;
  NameMonitor name_monitor_;
  std::string name_alarm_;  ///< empty: no other process has this node's name
  int64_t clock_steps_ = 0;
  Duration reported_step_{};
  MachineHealth machine_;
  ClockMonitor clock_;
  PtpMonitor ptp_;
  const std::unique_ptr<MetricsServer> metrics_;  ///< or null
  std::optional<Duration> watchdog_;
  MonotonicInstant last_fed_;
};

}  // namespace v3d
