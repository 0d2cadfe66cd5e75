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
#include "daemon/control/node_protocol.h"
#include "daemon/node/metrics_server.h"
#include "daemon/node/node_health.h"

namespace v3d::node {

/// Identity of a daemon.
struct NodeIdentity {
  std::string node;
  std::string program;  ///< "v3d-captured"
  bus::CredentialPaths credentials;
  std::string metrics;  ///< address of the Prometheus server; empty: none
};

/// Without a studio key, or without the member list and the signing key that the studio file names,
/// the node rejects every command; its log and its health explain how to create them. It reads
/// their files once a second, so they can be created or replaced without a restart, and passes the
/// signing key on to the delegate. One thread.
class NodeLoop {
 public:
  /// `delegate` and `bus` outlive the loop.
  NodeLoop(NodeIdentity identity, bus::Bus& bus, control::NodeDelegate& delegate);

  /// Result of a take that was active when the daemon ended (see Controller::set_last_result).
  void set_last_result(const std::string& take, const std::string& text,
                       const std::string& detail) {
    protocol_.set_last_result(take, text, detail);
  }

  /// Runs until stop_requested(). Then drains an active take, for at most kLastDrain, and closes it
  /// in a valid state.
  void run();
  /// One iteration of run(): executes at most one command, and everything that is due.
  void run_once();

 private:
  void on_command(const control::CommandReplayFilter::Admitted& admitted);
  bool may_mean_duplicate(const wire::CommandMessage& command) const;
  bool reject_for_duplicate_name(const wire::CommandMessage& command);
  void check_name(wire::HealthMessage& health);
  MonotonicInstant next_deadline() const;
  void publish(wire::ReplyMessage reply);
  void publish_due_health();
  void publish_health();
  void publish_shortened(wire::HealthMessage& health);
  void check_clock(wire::HealthMessage& health);
  /// Counters of commands, messages and datagrams.
  void report_counts(wire::HealthMessage& health) const;
  /// Appends problems of credentials, commands and messages to the text of `health`. A node that
  /// cannot keep up reports an attack, too.
  void report_problem(wire::HealthMessage& health) const;
  void read_credentials();
  void pass_on_signing_key();
  std::string credential_problem() const;
  void feed_watchdog();
  void shut_down();

  const NodeIdentity identity_;
  bus::Bus& bus_;
  control::NodeDelegate& delegate_;
  control::NodeProtocol protocol_;
  control::CommandReplayFilter filter_;
  bus::CredentialFiles files_;
  std::optional<wire::PublicKey> passed_key_;  ///< of the signing key that the delegate has
  bus::Subscription<control::CommandReplayFilter::Admitted> commands_;
  NameMonitor name_monitor_;
  bool is_stopping_ = false;
  std::string name_alarm_;  ///< empty: no other process has this node's name
  int64_t clock_steps_ = 0;
  Duration reported_step_{};
  MachineHealth machine_;
  const std::string version_;  ///< version_with_appliance()
  control::ClockMonitor clock_;
  control::PtpMonitor ptp_;
  const std::unique_ptr<MetricsServer> metrics_;  ///< or null
  std::optional<Duration> watchdog_;
  MonotonicInstant last_fed_;
};

}  // namespace v3d::node
