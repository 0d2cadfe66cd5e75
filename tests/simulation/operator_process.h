// Simulated operator: runs of v3dctl, one after the other, with the real StudioCoordinator.
#pragma once

#include <deque>
#include <functional>
#include <optional>
#include <string>

#include "daemon/control/studio_coordinator.h"
#include "simulation/node_setting.h"
#include "simulation/trace.h"

namespace v3d::simulation {

/// One run of v3dctl.
struct OperatorStep {
  wire::CommandMessage order;  ///< verb, take, pulses
  Duration timeout;            ///< of the order
  Duration then{};             ///< pause after the answer
};

/// Each step is a separate process with its own sender name. One thread.
class OperatorProcess {
 public:
  OperatorProcess(World& world, Trace& trace, std::string name, control::CommandTargets studio);

  void begin(std::deque<OperatorStep> steps);
  /// Kills the running process and drops the remaining steps.
  void kill();
  void set_clock_error(Duration error) { clock_error_ = error; }

  bool is_busy() const { return !steps_.empty() || coordinator_.has_value(); }
  size_t place() const { return place_; }
  /// The last answer; empty before the first.
  const std::optional<control::Answer>& answer() const { return answer_; }
  /// True when all steps of the last begin() were answered "done".
  bool was_done() const { return !is_busy() && all_done_; }

 private:
  void begin_next();
  void poll();
  void receive(const wire::Bytes& bytes);
  void finish();

  World& world_;
  Trace& trace_;
  const std::string name_;
  const control::CommandTargets studio_;
  size_t place_ = 0;
  Duration clock_error_{};
  std::deque<OperatorStep> steps_;
  std::optional<control::CommandStamp> stamp_;
  std::optional<control::StudioCoordinator> coordinator_;
  std::optional<control::Answer> answer_;
  bool all_done_ = true;
  int runs_ = 0;
  int64_t plan_ = 0;  ///< number of the newest planned action; older plans do nothing
};

}  // namespace v3d::simulation
