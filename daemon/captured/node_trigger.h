// The trigger of the studio as one capture node knows it: its own, or that of another node, of
// which it hears.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/studio_file.h"
#include "capture/sync/train_start.h"
#include "daemon/bus/bus.h"
#include "daemon/node/train_monitor.h"
#include "trigger/pulse_generator.h"

namespace v3d {

/// One thread; what sensor() gives may be another's.
class NodeTrigger {
 public:
  /// Touches no hardware. `studio` and `bus` outlive the trigger. Throws InputError where the
  /// studio file asks for what there is not.
  NodeTrigger(const Studio& studio, const std::string& node, Bus& bus);

  /// Pulses are made on this node.
  bool is_here() const { return generator_ != nullptr; }
  /// The sense line of this node; null elsewhere, and without one.
  PulseSensor* sensor() const { return sensor_.get(); }
  /// What is heard of the trigger's node; null on that node.
  TrainMonitor* watch() const { return watch_.get(); }
  /// The cameras hear of every pulse.
  bool tells_edges() const { return generator_ || is_sensed_; }

  /// These do to the generator what PulseGenerator says. Elsewhere there is nothing to do, and
  /// start() forgets what was heard of the train before.
  void arm(const PulseTrain& train);
  bool armed() { return !generator_ || generator_->armed(); }
  void start();
  void stop();

  /// Where no line senses the pulses, the first was when it was commanded: once, and only here.
  std::optional<PulseEdge> unsensed_first_pulse();
  /// Hears, elsewhere, what has come since; to be called often. `take` is the one that is recorded.
  void listen(const std::string& take);
  /// The same; true when the train is over, elsewhere as far as was heard.
  bool train_is_over(const std::string& take);

  /// The sense line's count is the better one.
  bool only_sensor_counts() const;
  /// Pulses of the train until now, of which this node has seen `seen`.
  int64_t commanded(int64_t seen) const;

  /// One line each; empty when nothing is wrong, and elsewhere.
  std::string fault() const { return generator_ ? generator_->fault() : ""; }
  std::string sensor_fault() const { return sensor_ ? sensor_->fault() : ""; }
  /// Empty elsewhere.
  std::optional<PulseStatistics> statistics() const;

 private:
  const bool is_sensed_;
  std::unique_ptr<PulseGenerator> generator_;  ///< null elsewhere
  std::unique_ptr<PulseSensor> sensor_;
  std::unique_ptr<TrainMonitor> watch_;
  bool first_pulse_told_ = false;
};

}  // namespace v3d
