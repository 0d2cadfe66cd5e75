// The cameras of one capture node.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "capture/cameras/camera_worker.h"
#include "capture/segmentation/background.h"
#include "capture/sync/pulse_times.h"

namespace v3d {

/// One thread, except for pulse_at().
class NodeCameras {
 public:
  /// Queue length of each camera: more than 1 s of frames, as long as a disk may stall.
  static constexpr size_t kQueueFrames = 32;
  using Workers = std::vector<std::unique_ptr<CameraWorker>>;

  /// Opens the cameras of `node` in the background. `studio` and `pulses` outlive this object.
  NodeCameras(const Studio& studio, const std::string& node, const PulseTimes& pulses);
  ~NodeCameras();
  NodeCameras(const NodeCameras&) = delete;
  NodeCameras& operator=(const NodeCameras&) = delete;

  Workers::const_iterator begin() const { return workers_.begin(); }
  Workers::const_iterator end() const { return workers_.end(); }
  size_t size() const { return workers_.size(); }

  /// These four call the function of the same name of every CameraWorker.
  void arm(Duration period, bool edges_are_reported);
  void pulse_at(const PulseEdge& edge);  ///< any thread
  void train_ended();
  void disarm();

  /// The cameras in state kReady, in the order of the studio file.
  std::vector<CameraWorker*> ready() const;
  /// The required cameras that are not ready, each with its reason, on one line; else empty.
  /// Cameras in `may_be_missing` are not required.
  std::string not_ready(const std::vector<std::string>& may_be_missing) const;
  /// Throws InputError when a camera has no calibration, or a required camera has no background
  /// model.
  void check_prepared(const std::vector<std::string>& may_be_missing) const;
  /// Throws InputError when the model has another image size or pixel format than the camera.
  BackgroundModel background_of(const CameraWorker& worker) const;

  /// Image bytes of one pulse: the sum over all cameras that have been opened at least once.
  double bytes_per_pulse() const;
  /// Length of the longest frame queue.
  int64_t max_queued() const;
  /// Frames dropped because a queue was full, over all cameras.
  int64_t dropped() const;
  /// The faults that cameras report, on one line; empty without faults.
  std::string fault_text() const;

 private:
  const Studio& studio_;
  Workers workers_;
};

}  // namespace v3d
