// Capture node: executes the orders of the node protocol with the cameras and the trigger of one
// PC.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "capture/sync/pulse_times.h"
#include "daemon/bus/bus.h"
#include "daemon/bus/event_sender.h"
#include "daemon/captured/active_take.h"
#include "daemon/captured/camera_monitor.h"
#include "daemon/captured/light_output.h"
#include "daemon/captured/live_admission.h"
#include "daemon/captured/node_devices.h"
#include "daemon/captured/node_sound.h"
#include "daemon/captured/take_rejoin.h"
#include "daemon/captured/take_signers.h"
#include "daemon/captured/timecode_output.h"
#include "daemon/control/node_protocol.h"
#include "daemon/node/node_health.h"
#include "daemon/node/peer_health.h"
#include "daemon/node/persisted_command.h"

namespace v3d::captured {

/// Arms in this order, so that the first frame is that of pulse 0: turn the generator off; wait
/// until all cameras stream and have sent no frame for two periods; report ready; on start, turn
/// the pulses on.
///
/// Also reports health, and sends events about cameras, disks and trigger. Call from one thread.
class CaptureNode : public control::NodeDelegate {
 public:
  /// Opens the cameras of `node` in the background. `studio` and `bus` outlive the node. Throws
  /// InputError when the node has neither camera nor trigger.
  CaptureNode(const Studio& studio, const std::string& node, bus::Bus& bus);
  ~CaptureNode() override;

  /// Sends an alarm with the first health: a take that the recovery at the start left open.
  void report_open_take(const std::string& line) { open_takes_.push_back(line); }

  void set_signing_key(const wire::SigningKey& key) override;
  void arm(const wire::CommandMessage& order) override;
  void learn(const wire::CommandMessage& order) override;
  std::optional<wire::CommandMessage> rejoin() override;
  void start() override;
  void drain() override;
  void disarm() override;
  std::optional<control::NodeReport> poll(control::Phase phase) override;
  void report_health(wire::HealthMessage& health) override;
  bool progressed_since(MonotonicInstant since) const override;

 private:
  void reset_for_order(const wire::CommandMessage& order, std::optional<int64_t> pulses);
  void prepare(const wire::CommandMessage& order, std::optional<int64_t> pulses);
  void arm_cameras();
  /// True while the generator is being armed; arms the cameras when it is ready. Throws what
  /// NodeTrigger::armed() throws.
  bool trigger_is_arming();
  bool is_check() const { return plan_.order.verb == wire::CommandVerb::kCheck; }
  std::string ready_text() const;

  ActiveTake::Context take_context();
  /// Passes a pulse on to cameras, sound and timecode. Any thread.
  void notify_cameras(const capture::PulseEdge& edge);
  /// Passes a pulse on to sound and timecode. Any thread.
  void notify_sound(const capture::PulseEdge& edge) {
    if (sound_) sound_->pulse_at(edge);
    if (timecode_) timecode_->pulse_at(edge);
  }

  std::optional<control::NodeReport> poll_arming();
  std::optional<control::NodeReport> poll_learning();
  std::optional<control::NodeReport> poll_recording();
  std::optional<control::NodeReport> poll_draining();
  control::NodeReport check_report(const TakeResult& result) const;
  /// Requires take_has_ledger().
  TakeResult close_take();

  bool take_has_ledger() const { return take_ && take_->has_ledger(); }
  /// Of the active take, else of the last one.
  TakeCounts take_counts() const { return take_has_ledger() ? take_->counts() : last_; }
  /// Data rate of all cameras at the pulse rate of the last order.
  double bytes_per_second() const;
  /// Why a full or broken disk, here or on another node, ends the take; empty if none does. Sends
  /// events about disks and frame queues.
  std::string check_disks();
  /// Returns why the take must end because of its number of pulses, and sends an alarm; empty: it
  /// may continue.
  std::string check_length();
  std::string fault_text() const;
  void report_take(const TakeCounts& counts, wire::HealthMessage& health) const;
  /// Connection and scene of the lamps, and an event about a fault.
  void report_lights(wire::HealthMessage& health);
  /// Sends events about disk, trigger, sense line and live picture: when a warning starts, changes
  /// or ends.
  void report_warnings(const TakeCounts& counts);
  std::string trigger_warning(const TakeCounts& counts) const;
  /// Sends events about takes that were signed after their recovery.
  void report_signed_takes(wire::HealthMessage& health);

  const Studio& studio_;
  const std::string node_;
  bus::Bus& bus_;
  bus::EventSender events_;
  CameraMonitor camera_monitor_;
  CameraSettingsFile camera_settings_;
  capture::PulseTimes pulse_times_;  ///< as sensed here
  NodeTrigger trigger_;
  // Null unless the trigger is on this node.
  std::unique_ptr<node::DiskMonitor> disk_monitor_;
  std::unique_ptr<FirmwareMonitor> firmware_monitor_;
  node::PersistedCommands persisted_commands_;
  NodeCameras cameras_;
  PrioritySemaphore slots_;
  std::unique_ptr<TimecodeOutput> timecode_;  ///< null: the node plays no timecode
  std::unique_ptr<NodeSound> sound_;          ///< null: the node has no sound input
  std::unique_ptr<LightOutput> lights_;       ///< null: the node sends no light
  NodeSigner signer_;
  RecoveredTakeSigner recovered_takes_;
  TakeRejoin rejoin_;
  std::vector<std::string> open_takes_;  ///< not reported yet

  ActiveTake::Plan plan_;       ///< of the last order
  bool cameras_armed_ = false;  ///< for the last order
  std::string clock_fault_;     ///< why action commands of the last order have no time; else empty
  MonotonicInstant ready_by_;
  std::unique_ptr<ActiveTake> take_;  ///< null when nothing runs
  TakeCounts last_;                   ///< of the last take
  bool disk_is_full_ = false;         ///< a full or broken disk of this node ended the last take
};

}  // namespace v3d::captured
