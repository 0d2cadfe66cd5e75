// Detects cameras that moved since the calibration, from the silhouettes of a take while it is
// reconstructed.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "recon/pipeline/reconstructor.h"
#include "recon/silhouettes/displaced_camera.h"

namespace v3d::recond {

/// Measures displacements (DisplacementMeter) of the cameras of one rig in spare time.
///
/// Samples a pulse every kFirstPeriod, and every kPeriod once it has a result. Works on one thread
/// with SCHED_IDLE priority, which runs when no other thread is ready to run. When a sample
/// takes longer than `starved_after`, the thread gets the priority of nice kStarvedNice until it
/// has a result: a busy PC reports a displaced camera, too. This needs CAP_SYS_NICE or RLIMIT_NICE;
/// without, the priority stays idle.
/// Under v3d-recond@.service no thread may change its priority. There the thread pauses before each
/// hull while a frame set is reconstructed. When a sample takes longer than `starved_after`, it
/// works nevertheless, and rests kRestPerWork times as long as it worked.
/// No function waits for the thread except the destructor. With fewer than kMinCameras cameras the
/// monitor does nothing: the leave-one-out hull is then too wide to locate a camera.
class DisplacementMonitor {
 public:
  static constexpr size_t kMinCameras = 12;
  static constexpr int64_t kMinPulses = 8;  ///< before there is a result
  static constexpr Duration kFirstPeriod = std::chrono::milliseconds(400);
  static constexpr Duration kPeriod = std::chrono::seconds(5);
  static constexpr Duration kStarvedAfter = std::chrono::seconds(5);
  static constexpr int kStarvedNice = 10;
  static constexpr int kRestPerWork = 9;

  DisplacementMonitor(const Rig& rig, const recon::ReconstructOptions& options,
                      Duration starved_after = kStarvedAfter);
  /// Waits for the measurement in progress, which may take long on a busy machine. To avoid this,
  /// call stop() and wait for has_stopped().
  ~DisplacementMonitor();
  DisplacementMonitor(const DisplacementMonitor&) = delete;
  DisplacementMonitor& operator=(const DisplacementMonitor&) = delete;

  /// Moves the masks out of `set`, which is no longer needed, when a sample is due and the thread
  /// is free. Otherwise leaves it unchanged. One thread.
  void offer(recon::FrameSet& set);

  /// The result of the last pulses, by camera of the rig; empty before there is one. Returns the
  /// previous result while a new one is being stored. One thread.
  const std::vector<recon::CameraDisplacement>& result();

  /// Counts the frame sets that are reconstructed now. Any thread.
  void begin_set() { ++sets_in_progress_; }
  void end_set() { --sets_in_progress_; }
  /// Does the thread pause because of these sets? Any thread.
  bool is_paused() const { return paused_; }

  /// Starts no further measurement. Does not wait.
  void stop();
  /// Has the thread ended? Then the destructor does not wait.
  bool has_stopped() const { return stopped_; }

 private:
  using Masks = std::vector<std::optional<Mask>>;

  void run();
  void measure(const Masks& masks);
  void raise_priority_if_starved(MonotonicInstant now);
  void pause_while_reconstructing();

  const Rig rig_;
  const Duration starved_after_;
  recon::LeaveOneOutHull hulls_;  ///< used by the thread only, as are the next three
  recon::DisplacementMeter meter_;
  std::vector<Mask> views_;
  MonotonicInstant resumed_;                         ///< end of the last pause
  MonotonicInstant next_sample_;                     ///< used by offer()
  std::vector<recon::CameraDisplacement> returned_;  ///< by result()
  std::atomic<bool> stopped_ = true;
  std::atomic<int> sets_in_progress_ = 0;
  std::atomic<bool> paused_ = false;
  std::mutex mutex_;  ///< guards the members below
  std::condition_variable changed_;
  bool stopping_ = false;
  bool busy_ = false;
  bool may_idle_ = true;  ///< the thread may have idle priority
  bool raised_ = false;   ///< the thread has more than idle priority
  MonotonicInstant busy_since_;
  bool has_result_ = false;
  std::optional<Masks> waiting_;
  std::vector<recon::CameraDisplacement> result_;
  std::thread thread_;  ///< last: it uses all of the above
};

}  // namespace v3d::recond
