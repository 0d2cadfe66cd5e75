// The delegate of a reconstruction node: opens, polls and closes the ReconPipeline of each take,
// and reports its counts as health and events.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "daemon/bus/bus.h"
#include "daemon/bus/event_sender.h"
#include "daemon/control/node_protocol.h"
#include "daemon/node/persisted_command.h"
#include "daemon/recond/displacement_monitor.h"
#include "daemon/recond/recon_pipeline.h"

namespace v3d::recond {

class ReconNode : public control::NodeDelegate {
 public:
  /// `studio` and `bus` must outlive this object.
  ReconNode(const Studio& studio, const std::string& node, bus::Bus& bus);
  ~ReconNode() override;

  void arm(const wire::CommandMessage& command) override;
  void learn(const wire::CommandMessage& command) override;
  std::optional<wire::CommandMessage> rejoin() override;
  void start() override { train_.reset(); }
  void drain() override;
  void disarm() override;
  std::optional<control::NodeReport> poll(control::Phase phase) override;
  void report_health(wire::HealthMessage& health) override;
  bool progressed_since(MonotonicInstant since) const override;

 private:
  /// `resume_at`: see ReconPipeline::Setup.
  void open(const wire::CommandMessage& command, std::optional<int64_t> resume_at);
  /// Empty where the studio does not repair silhouettes.
  std::optional<LiveRepair::Setup> repair_setup(const Rig& rig,
                                                const recon::ReconstructOptions& options) const;
  /// Empty where this is the only reconstruction node.
  std::optional<Shard::Setup> shard_setup(const wire::CommandMessage& command,
                                          bool joins_late) const;
  control::NodeReport ready_report() const;
  std::optional<control::NodeReport> poll_recording();
  std::optional<control::NodeReport> poll_draining();
  void report_displacement(wire::HealthMessage& health);
  void report_repairs(const ReconCounts& counts);
  void stop_displacement_monitor();

  const Studio& studio_;
  const std::string node_;
  bus::Bus& bus_;
  bus::EventSender events_;
  node::TrainMonitor train_;
  node::PersistedCommands persisted_commands_;
  wire::CommandMessage command_;  ///< the last arm, check or background command
  MonotonicInstant drain_began_;
  std::unique_ptr<DisplacementMonitor> displacement_monitor_;
  /// Of previous takes: still stopping.
  std::vector<std::unique_ptr<DisplacementMonitor>> stopping_monitors_;
  std::unique_ptr<ReconPipeline> pipeline_;  ///< passes its sets to displacement_monitor_
  recon::CameraDisplacement
      reported_displacement_;  ///< last one of this take; without a name: none
  std::map<std::string, bus::EventThrottle> repair_events_;  ///< of this take, by camera
  ReconCounts last_;                                         ///< of the last take
};

}  // namespace v3d::recond
