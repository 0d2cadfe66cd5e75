// The running take, check or background recording of a capture node, from arming until its result
// is known.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "daemon/bus/bus.h"
#include "daemon/captured/live_admission.h"
#include "daemon/captured/node_devices.h"
#include "daemon/captured/node_take.h"
#include "daemon/captured/pulse_recorder.h"
#include "daemon/captured/unrecorded_trains.h"

namespace v3d::captured {

/// Progress of a take or check.
struct TakeCounts {
  CameraPipelineCounts frames;  ///< 0 where nothing is recorded
  int64_t pulses_not_live = 0;
  int64_t sensed = 0;
  int64_t commanded = 0;
};

/// Result of a take or check.
struct TakeResult {
  take::Ledger ledger;                 ///< without cameras where nothing was recorded
  TakeCloseReport close_report;        ///< empty where nothing was recorded
  std::vector<CheckedCamera> checked;  ///< empty unless this was a check
  std::optional<CheckedSound> sound;   ///< of a check on a node with sound input
  TakeCounts counts;
};

/// Throws InputError for implausible values, because commands come from the network.
void check_order(const wire::CommandMessage& order);

/// Why a train without a number of pulses must end: a longer take could not be read. Empty: it may
/// continue. `commanded`: its pulses so far.
std::string length_stop_reason(const trigger::PulseTrain& train, int64_t commanded);

/// Idle time after which an ended train counts as drained: ten periods, at least
/// PulseTimes::kMaxSenseDelay, at most 1 s.
Duration idle_time_after_train(double rate_hz);

/// Receives the pulses and frames of one train. A take records them, a check measures image
/// quality, a background order learns the background model.
///
/// The owner arms and disarms cameras and trigger, and polls this object for progress. The
/// destructor closes files without writing a ledger. Call from one thread; the parts have threads
/// of their own.
class ActiveTake {
 public:
  /// Everything referred to outlives the take.
  struct Context : NodeTake::Context {
    NodeTrigger& trigger;
    std::function<void(const capture::PulseEdge&)>
        on_edge;  ///< called for every pulse on another thread
  };
  struct Plan {
    wire::CommandMessage order;
    trigger::PulseTrain train;  ///< for a background: as many pulses as plates
  };

  /// Starts the take, check or background that `plan.order` requests. Cameras and trigger are
  /// armed. Throws InputError when the disk fails check_disk(), or the sense line cannot be opened.
  static std::unique_ptr<ActiveTake> begin(Context context, Plan plan);
  /// Resumes a take that this node recorded before its daemon restarted. Pulses run. Throws
  /// InputError; the caller must then disarm the cameras.
  static std::unique_ptr<ActiveTake> resume(Context context, Plan plan, TakeToResume resumed);

  /// The disk space and rate that a take of these cameras needs.
  static DiskDemand disk_demand(const NodeCameras& cameras, const Plan& plan);

  ~ActiveTake();
  ActiveTake(const ActiveTake&) = delete;
  ActiveTake& operator=(const ActiveTake&) = delete;

  /// Call directly before the generator is started. Earlier pulses on the sense line are extra.
  void start();
  /// Call after the last pulse. Idempotent.
  void train_ended();
  /// After train_ended(): true when every frame and pulse has arrived, or none has arrived for up
  /// to 1 s, or 15 s have passed.
  bool is_drained() const;
  /// Result of learning the background; empty until it is finished.
  std::optional<BackgroundLearner::Result> background_result();

  /// True for takes and checks, false for a background.
  bool has_ledger() const { return recording_ || check_; }
  /// The frames of this camera are in the ledger. False for a camera that was not ready at the
  /// start, and for a background.
  bool counts_frames_of(const std::string& camera) const {
    return recording_ ? recording_->records(camera) : check_ && check_->examines(camera);
  }
  /// Requires has_ledger().
  TakeCounts counts() const;
  /// Stops all threads and closes the take on disk. Requires has_ledger(). Only the destructor may
  /// be called afterwards.
  TakeResult close();

  /// Null where nothing is recorded.
  NodeTake* recording() const { return recording_.get(); }
  const PulseRecorder& pulses() const { return *pulses_; }
  /// True when every thread has passed its main loop since `since`.
  bool progressed_since(MonotonicInstant since) const;

 private:
  ActiveTake(Context context, Plan plan) : context_(std::move(context)), plan_(std::move(plan)) {}
  NodeTake::Plan recording_plan() const;
  void start_recording();
  void resume_recording(TakeToResume resumed);
  void start_check();
  std::optional<CheckedSound> end_sound_check();
  /// Writes no log where `log` is empty.
  void start_pulse_recorder(const std::filesystem::path& log,
                            std::optional<PulseRecorder::Resume> resume = {});
  int64_t commanded() const { return context_.trigger.commanded(pulses_->seen()); }
  bool sensed_count_is_known(int64_t commanded) const;
  bool pulses_are_complete(bool is_idle) const;

  const Context context_;
  const Plan plan_;
  bool was_started_ = false;
  MonotonicInstant train_ended_at_;
  std::unique_ptr<PulseRecorder> pulses_;  ///< outlives the consumers of the frames
  std::unique_ptr<NodeTake> recording_;    ///< at most one of these three is not null
  std::unique_ptr<CameraCheck> check_;
  std::unique_ptr<BackgroundLearner> learner_;
  /// Of a background: the cameras that were ready at begin(). One that is lost later is an error.
  std::vector<capture::CameraWorker*> learnt_cameras_;
  bool listens_ = false;  ///< the sound input detects a clap
};

}  // namespace v3d::captured
