// The studio's trigger as seen by one capture node: its own generator and sense line, or the health
// messages of the node that has them.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/config/studio_file.h"
#include "capture/sync/train_start.h"
#include "daemon/bus/bus.h"
#include "daemon/node/train_monitor.h"
#include "trigger/pulse_generator.h"

namespace v3d {

/// One thread; the sensor() may be read by another.
class NodeTrigger {
 public:
  /// Touches no hardware. `studio` and `bus` outlive the trigger. Throws InputError when a trigger
  /// setting of the studio file is not supported.
  NodeTrigger(const Studio& studio, const std::string& node, Bus& bus);

  /// The pulses are generated on this node.
  bool is_here() const { return generator_ != nullptr; }
  /// The sense line of this node; null on other nodes and without a sense line.
  PulseSensor* sensor() const { return sensor_.get(); }
  /// Health of the trigger's node; null on that node.
  TrainMonitor* monitor() const { return monitor_.get(); }
  /// The cameras receive the time of every pulse (CameraWorker::pulse_at).
  bool reports_edges() const { return generator_ || is_sensed_; }

  /// These four call PulseGenerator's functions. On other nodes they do nothing, except that
  /// start() resets the monitor.
  void arm(const PulseTrain& train);
  bool armed() { return !generator_ || generator_->armed(); }
  void start();
  void stop();

  /// Without a sense line: pulse 0 with the time at which it was commanded. Returned once per
  /// train, and on the trigger's node only.
  std::optional<PulseEdge> unsensed_first_pulse();
  /// On other nodes: reads the health messages that have arrived. Call it often. `take`: the take
  /// being recorded.
  void poll(const std::string& take);
  /// Calls poll(). True when this node has received or sensed the end of the train.
  bool train_has_ended(const std::string& take);

  /// The generator does not count pulses exactly, but the sense line does.
  bool sensor_count_is_better() const;
  /// Pulses of the train until now. `seen`: pulses that this node has seen.
  int64_t commanded(int64_t seen) const;
  /// False on another node that has not heard the end of the train: it may go on.
  bool end_is_known() const { return generator_ || monitor_->ended(); }

  /// One line each; empty without a fault, and on other nodes.
  std::string fault() const { return generator_ ? generator_->fault() : ""; }
  std::string sensor_fault() const { return sensor_ ? sensor_->fault() : ""; }
  /// Empty on other nodes.
  std::optional<PulseStatistics> statistics() const;

 private:
  const bool is_sensed_;
  std::unique_ptr<PulseGenerator> generator_;  ///< null on other nodes
  std::unique_ptr<PulseSensor> sensor_;
  std::unique_ptr<TrainMonitor> monitor_;
  bool first_pulse_reported_ = false;
};

}  // namespace v3d
