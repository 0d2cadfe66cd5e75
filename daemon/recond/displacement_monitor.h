// Whether the cameras stand where they were calibrated, asked of the silhouettes while a take is
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

namespace v3d {

/// Looks at two or three pulses a second at first and, when it has an opinion, at one every five
/// seconds. It works in spare time: on one thread, which runs when no other wants the processor
/// (SCHED_IDLE), and nothing ever waits for it but the destructor. With fewer than kMinCameras
/// cameras it does nothing: the hull of the others is too wide then to say where a camera stands.
class DisplacementMonitor {
 public:
  static constexpr size_t kMinCameras = 12;
  static constexpr int64_t kMinPulses = 8;  ///< before it says anything
  static constexpr Duration kFirstPeriod = std::chrono::milliseconds(400);
  static constexpr Duration kPeriod = std::chrono::seconds(5);

  DisplacementMonitor(const Rig& rig, const ReconstructOptions& options);
  /// Waits for what the thread is at, which may be long where others want the processor: see end().
  ~DisplacementMonitor();
  DisplacementMonitor(const DisplacementMonitor&) = delete;
  DisplacementMonitor& operator=(const DisplacementMonitor&) = delete;

  /// Takes the masks of a set that nobody needs any more, where it has time for them; else the set
  /// stays as it is. One thread.
  void offer(FrameSet& set);

  /// By camera of the rig, of the last pulses; empty before it has an opinion. One thread. The last
  /// answer when there is a new one that cannot be had at once.
  const std::vector<CameraDisplacement>& result();

  /// Nothing more is looked at but what the thread is at.
  void end();
  /// The destructor would wait for nothing.
  bool has_ended() const { return ended_; }

 private:
  using Masks = std::vector<std::optional<Mask>>;

  void run();
  void look(const Masks& masks);

  const Rig rig_;
  LeaveOneOutHull hulls_;  ///< the thread's, as are the next two
  DisplacementMeter meter_;
  std::vector<Mask> views_;
  MonotonicInstant next_look_;            ///< offer()
  std::vector<CameraDisplacement> told_;  ///< result()
  std::atomic<bool> ended_ = true;
  std::mutex mutex_;  ///< what follows
  std::condition_variable changed_;
  bool stopping_ = false;
  bool busy_ = false;
  bool has_opinion_ = false;
  std::optional<Masks> waiting_;
  std::vector<CameraDisplacement> result_;
  std::thread thread_;  ///< last: it works with all of the above
};

}  // namespace v3d
