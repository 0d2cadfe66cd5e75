// What a capture node is in the middle of, from the moment it is ready until the account is given:
// the pulses of a train, and what is made of their frames. A take is recorded; a check looks at
// them; the background is learnt of them.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/studio_file.h"
#include "daemon/bus/bus.h"
#include "daemon/captured/background_learner.h"
#include "daemon/captured/camera_check.h"
#include "daemon/captured/node_cameras.h"
#include "daemon/captured/node_take.h"
#include "daemon/captured/node_trigger.h"
#include "daemon/captured/priority_semaphore.h"
#include "daemon/captured/pulse_recorder.h"

namespace v3d {

/// How far it has come.
struct TakeCounts {
  CameraPipelineCounts frames;  ///< of a take that is recorded
  int64_t pulses_not_live = 0;
  int64_t sensed = 0;
  int64_t commanded = 0;
};

/// What there is to tell at its end.
struct TakeAccount {
  Ledger ledger;                       ///< without cameras where nothing was recorded
  TakeClosing closing;                 ///< of a take that was recorded
  std::vector<CheckedCamera> checked;  ///< by a check
  TakeCounts counts;
};

/// Knows neither who ordered it nor who is told of it: cameras and trigger are armed and turned off
/// by its owner, who asks it how it goes. Destroyed, it ends what is open without an account. One
/// thread, and those of its parts.
class ActiveTake {
 public:
  /// All outlive it.
  struct Node : NodeTake::Node {
    NodeTrigger& trigger;
    std::function<void(const PulseEdge&)> on_edge;  ///< for every pulse, on a thread of its own
  };
  struct Plan {
    CommandMessage order;
    PulseTrain train;  ///< of the background: as many pulses as plates
  };

  /// What an order asks for; its cameras and the trigger are armed. Throws InputError when the disk
  /// is not fit for a take, or the pulses cannot be sensed.
  static std::unique_ptr<ActiveTake> begin(Node node, Plan plan);
  /// A take that this node was in before it was started anew; pulses run, and are `commanded` by
  /// now. Throws InputError; what it did to the cameras until then, disarming them undoes.
  static std::unique_ptr<ActiveTake> go_on(Node node, Plan plan, int64_t commanded);

  /// What is asked of the disk by a take of these cameras.
  static DiskDemand disk_demand(const NodeCameras& cameras, const Plan& plan);

  /// The pulses are about to come.
  void start();
  /// No pulse comes any more. Idempotent.
  void train_ended();
  /// After train_ended(): every frame and pulse is here, or will not come.
  bool is_accounted_for() const;
  /// What came of the background; empty while it is being learnt.
  std::optional<BackgroundLearner::Result> learnt();

  /// There is an account to give: a take's, or a check's.
  bool is_counted() const { return recording_ || check_; }
  /// Requires is_counted().
  TakeCounts counts() const;
  /// Ends frames and pulses; a take is closed. Nothing else may be asked afterwards. Requires
  /// is_counted().
  TakeAccount close();

  /// Null where nothing is recorded.
  NodeTake* recording() const { return recording_.get(); }
  const PulseRecorder& pulses() const { return *pulses_; }
  bool progressed_since(MonotonicInstant since) const;

 private:
  ActiveTake(Node node, Plan plan) : node_(std::move(node)), plan_(std::move(plan)) {}
  NodeTake::Plan recording_plan() const;
  void record();
  void record_again(int64_t commanded);
  void look();
  /// An empty `log` is not written.
  void listen_to_pulses(const std::filesystem::path& log,
                        std::optional<PulseRecorder::Past> past = {});
  int64_t commanded() const { return node_.trigger.commanded(pulses_->seen()); }
  bool knows_what_was_sensed(int64_t commanded) const;
  bool pulses_are_known(bool silent) const;

  const Node node_;
  const Plan plan_;
  bool was_started_ = false;
  MonotonicInstant ended_;
  std::unique_ptr<PulseRecorder> pulses_;  ///< outlives what is made of the frames
  std::unique_ptr<NodeTake> recording_;    ///< at most one of these three
  std::unique_ptr<CameraCheck> check_;
  std::unique_ptr<BackgroundLearner> learner_;
};

}  // namespace v3d
