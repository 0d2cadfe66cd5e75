// The cameras of one capture node, as the node sees them: all that it has, and those that are
// ready.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/studio_file.h"
#include "capture/cameras/camera_worker.h"
#include "capture/segmentation/background.h"
#include "capture/sync/pulse_times.h"

namespace v3d {

/// One thread, but for pulse_at().
class NodeCameras {
 public:
  /// Frames of one camera that may wait, more than a second of them: as long as a disk may
  /// hesitate.
  static constexpr size_t kQueueFrames = 32;
  using Workers = std::vector<std::unique_ptr<CameraWorker>>;

  /// Opens the cameras of `node` in the background. `studio` and `pulses` outlive them.
  NodeCameras(const Studio& studio, const std::string& node, const PulseTimes& pulses);
  ~NodeCameras();
  NodeCameras(const NodeCameras&) = delete;
  NodeCameras& operator=(const NodeCameras&) = delete;

  Workers::const_iterator begin() const { return workers_.begin(); }
  Workers::const_iterator end() const { return workers_.end(); }
  size_t size() const { return workers_.size(); }

  /// These do to every camera what CameraWorker says.
  void arm(Duration period, bool edges_are_told);
  void pulse_at(const PulseEdge& edge);  ///< any thread
  void train_ended();
  void disarm();

  /// In the order of the studio file.
  std::vector<CameraWorker*> ready() const;
  /// Cameras that must be ready and are not, with why; empty when all are.
  std::string not_ready(const std::vector<std::string>& may_be_missing) const;
  /// Throws InputError where a camera has no calibration, or no background and must have one.
  void refuse_unprepared(const std::vector<std::string>& may_be_missing) const;
  /// Throws InputError where it is of other pictures than the camera takes now.
  BackgroundModel background_of(const CameraWorker& worker) const;

  /// What all cameras that were ever opened send with every pulse.
  double bytes_per_pulse() const;
  /// Frames that wait behind the camera that is farthest behind.
  int64_t most_waiting() const;
  /// Frames that nobody took in time, of all cameras together.
  int64_t dropped() const;
  /// What cameras say is wrong with them, one line; empty when nothing is.
  std::string trouble() const;

 private:
  const Studio& studio_;
  Workers workers_;
};

}  // namespace v3d
