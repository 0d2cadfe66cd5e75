// What a capture node does: makes its cameras and the trigger ready, records takes, learns the
// background.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/studio_file.h"
#include "capture/pulse_times.h"
#include "daemon/background_learner.h"
#include "daemon/bus.h"
#include "daemon/camera_check.h"
#include "daemon/camera_watch.h"
#include "daemon/event_sender.h"
#include "daemon/full_disk_watch.h"
#include "daemon/kept_order.h"
#include "daemon/node_cameras.h"
#include "daemon/node_take.h"
#include "daemon/node_work.h"
#include "daemon/pulse_recorder.h"
#include "daemon/train_watch.h"
#include "trigger/pulse_generator.h"

namespace v3d {

/// Order of arming: generator off -> all cameras streaming and quiet for two periods -> ready ->
/// (start) pulses on. So the first frame after the quiet is pulse 0.
class CaptureNode : public NodeWork {
 public:
  /// Opens the cameras of `node` in the background. `studio` and `bus` outlive the node. Throws
  /// InputError when the node has neither camera nor trigger.
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
  void make_ready(const CommandMessage& order, std::optional<int64_t> pulses);
  void arm_cameras();
  std::map<std::string, ChromaKey> chroma_keys() const;
  /// The generator takes its time; arms the cameras when it is done. Throws what armed() throws.
  bool is_arming_trigger();
  /// Any thread.
  void tell_cameras(const PulseEdge& edge);
  /// Where no line senses the pulses, it was when it was commanded.
  void tell_first_pulse();

  bool train_is_over();
  NodeReport poll_arming();
  std::optional<NodeReport> poll_learning();
  std::optional<NodeReport> poll_recording();
  std::optional<NodeReport> poll_draining();

  bool checks() const { return order_.verb == CommandVerb::kCheck; }
  /// Looks with the cameras that are ready, whatever the others do.
  void open_check();
  NodeReport check_report();

  struct TakeTotals {
    LaneCounts frames;
    int64_t pulses_not_live = 0;
    int64_t sensed = 0;
    int64_t commanded = 0;
  };
  TakeTotals totals() const;
  void open_take();
  void begin_order(const CommandMessage& order, std::optional<int64_t> pulses);
  bool edges_are_told() const { return generator_ || studio_.trigger.is_sensed(); }
  /// Records into a take that this node was in before it was started anew.
  void reopen_take(int64_t commanded);
  NodeTake::Node of_this_node() { return {studio_, node_, bus_, cameras_, places_}; }
  NodeTake::Plan plan() const { return {.order = order_, .disk = disk_demand()}; }
  /// An empty `log` is not written.
  void listen_to_pulses(const std::filesystem::path& log,
                        std::optional<PulseRecorder::Past> past = {});
  /// Ends lanes and pulses; gives the account. Requires that pulses are recorded. A take is still
  /// to be closed.
  Ledger finish();
  /// A take's, or a check's.
  bool records_pulses() const { return pulses_ && (take_ || check_); }
  bool only_sensor_counts() const;
  int64_t commanded() const;
  bool all_accounted_for() const;
  std::string ready_text() const;
  /// What the cameras record, at the rate of the last order.
  double bytes_per_second() const;
  DiskDemand disk_demand() const;
  /// Why a full or broken disk ends the take, here or elsewhere; empty while none does. Tells when
  /// frames wait.
  std::string look_at_disks();
  std::string trouble() const;
  /// Troubles of the disk and the trigger, told when they begin, change and end.
  void tell_troubles(const TakeTotals& sum);
  std::string trigger_trouble(const TakeTotals& sum) const;

  const Studio& studio_;
  const std::string node_;
  Bus& bus_;
  EventSender events_;
  CameraWatch camera_watch_;
  std::unique_ptr<PulseGenerator> generator_;  ///< null where another node has the trigger
  std::unique_ptr<PulseSensor> sensor_;        ///< null with it, and without a sense line
  PulseTimes pulse_times_;                     ///< as sensed here
  std::unique_ptr<TrainWatch> train_;          ///< null where the trigger is here
  std::unique_ptr<FullDiskWatch> full_disks_;  ///< null where it is not
  KeptOrders kept_orders_;
  NodeCameras cameras_;
  WorkPlaces places_;

  CommandMessage order_;
  bool cameras_armed_ = false;  ///< for the order
  double rate_hz_ = 0;
  PulseTrain pulse_train_;
  bool first_pulse_told_ = false;
  MonotonicInstant ready_by_;
  MonotonicInstant drain_began_;
  std::unique_ptr<PulseRecorder> pulses_;
  std::unique_ptr<NodeTake> take_;  ///< null when none is open
  TakeTotals totals_;               ///< of the last take
  bool disk_is_full_ = false;       ///< or broken: that ended the last take here
  std::unique_ptr<BackgroundLearner> learner_;
  std::unique_ptr<CameraCheck> check_;
};

}  // namespace v3d
