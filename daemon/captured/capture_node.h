// What a capture node does: makes its cameras and the trigger ready for what is ordered, follows
// the take that is under way, and tells of both.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/studio_file.h"
#include "capture/sync/pulse_times.h"
#include "daemon/bus/bus.h"
#include "daemon/bus/event_sender.h"
#include "daemon/captured/active_take.h"
#include "daemon/captured/camera_monitor.h"
#include "daemon/captured/node_cameras.h"
#include "daemon/captured/node_trigger.h"
#include "daemon/captured/priority_semaphore.h"
#include "daemon/control/node_delegate.h"
#include "daemon/node/disk_monitor.h"
#include "daemon/node/persisted_command.h"

namespace v3d {

/// Order of arming: generator off -> all cameras streaming and quiet for two periods -> ready ->
/// (start) pulses on. So the first frame after the quiet is pulse 0.
class CaptureNode : public NodeDelegate {
 public:
  /// Opens the cameras of `node` in the background. `studio` and `bus` outlive the node. Throws
  /// InputError when the node has neither camera nor trigger, or its signing key cannot be read.
  CaptureNode(const Studio& studio, const std::string& node, Bus& bus);
  ~CaptureNode() override;

  void arm(const CommandMessage& order) override;
  void learn(const CommandMessage& order) override;
  std::optional<CommandMessage> rejoin() override;
  void start() override;
  void drain() override;
  void disarm() override;
  std::optional<NodeReport> poll(Phase phase) override;
  void report_health(HealthMessage& health) override;
  bool progressed_since(MonotonicInstant since) const override;

 private:
  void begin_order(const CommandMessage& order, std::optional<int64_t> pulses);
  void make_ready(const CommandMessage& order, std::optional<int64_t> pulses);
  void arm_cameras();
  /// The generator takes its time; arms the cameras when it is done. Throws what armed() throws.
  bool is_arming_trigger();
  bool checks() const { return plan_.order.verb == CommandVerb::kCheck; }
  std::string ready_text() const;

  ActiveTake::Node of_this_node();
  /// Any thread.
  void tell_cameras(const PulseEdge& edge);

  std::optional<NodeReport> poll_arming();
  std::optional<NodeReport> poll_learning();
  std::optional<NodeReport> poll_recording();
  std::optional<NodeReport> poll_draining();
  NodeReport check_report(const TakeAccount& account) const;
  /// Requires that it is counted.
  TakeAccount close_take();

  bool counts_take() const { return take_ && take_->is_counted(); }
  /// Of the take that is under way, else of the last one.
  TakeCounts take_counts() const { return counts_take() ? take_->counts() : last_; }
  /// What the cameras record, at the rate of the last order.
  double bytes_per_second() const;
  /// Why a full or broken disk ends the take, here or elsewhere; empty while none does. Tells when
  /// frames wait.
  std::string look_at_disks();
  std::string trouble() const;
  void report_take(const TakeCounts& counts, HealthMessage& health) const;
  /// Troubles of the disk and the trigger, told when they begin, change and end.
  void tell_troubles(const TakeCounts& counts);
  std::string trigger_trouble(const TakeCounts& counts) const;

  const Studio& studio_;
  const std::string node_;
  Bus& bus_;
  EventSender events_;
  CameraMonitor camera_watch_;
  PulseTimes pulse_times_;  ///< as sensed here
  NodeTrigger trigger_;
  std::unique_ptr<DiskMonitor> full_disks_;  ///< null where the trigger is not
  PersistedCommands kept_orders_;
  NodeCameras cameras_;
  PrioritySemaphore places_;
  const std::optional<TakeSigner> signer_;  ///< empty: takes are not signed

  ActiveTake::Plan plan_;       ///< of the last order
  bool cameras_armed_ = false;  ///< for the order
  MonotonicInstant ready_by_;
  std::unique_ptr<ActiveTake> take_;  ///< null when none is under way
  TakeCounts last_;                   ///< of the last take
  bool disk_is_full_ = false;         ///< or broken: that ended the last take here
};

}  // namespace v3d
