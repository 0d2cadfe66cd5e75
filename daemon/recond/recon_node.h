// What the reconstruction node does: meshes while a take is recorded.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/studio_file.h"
#include "daemon/bus/bus.h"
#include "daemon/bus/event_sender.h"
#include "daemon/control/node_delegate.h"
#include "daemon/node/persisted_command.h"
#include "daemon/node/train_monitor.h"
#include "daemon/recond/displacement_monitor.h"
#include "daemon/recond/recon_pipeline.h"

namespace v3d {

class ReconNode : public NodeDelegate {
 public:
  /// `studio` and `bus` outlive the node.
  ReconNode(const Studio& studio, const std::string& node, Bus& bus);
  ~ReconNode() override;

  void arm(const CommandMessage& order) override;
  void learn(const CommandMessage& order) override;
  std::optional<CommandMessage> rejoin() override;
  void start() override { train_.reset(); }
  void drain() override;
  void disarm() override;
  std::optional<NodeReport> poll(Phase phase) override;
  void report_health(HealthMessage& health) override;
  bool progressed_since(MonotonicInstant since) const override;

 private:
  /// `goes_on_at`: as ReconPipeline's.
  void open(const CommandMessage& order, std::optional<int64_t> goes_on_at);
  /// This node's part, where several reconstruct.
  std::optional<Shard::Setup> share_of(const CommandMessage& order, bool comes_later) const;
  NodeReport ready_report() const;
  std::optional<NodeReport> poll_recording();
  std::optional<NodeReport> poll_draining();
  void report_drift(HealthMessage& health);
  void end_drift_watch();

  const Studio& studio_;
  const std::string node_;
  Bus& bus_;
  EventSender events_;
  TrainMonitor train_;
  PersistedCommands kept_orders_;
  CommandMessage order_;
  MonotonicInstant drain_began_;
  std::unique_ptr<DisplacementMonitor> drift_;
  std::vector<std::unique_ptr<DisplacementMonitor>>
      leaving_;                              ///< of takes before: told to end, and at work
  std::unique_ptr<ReconPipeline> pipeline_;  ///< offers its sets to the watch
  CameraDisplacement knocked_;  ///< what was told last of this take; without a name: nothing
  ReconCounts last_;            ///< of the last take
};

}  // namespace v3d
