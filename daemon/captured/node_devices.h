// Cameras and trigger of one node.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "capture/cameras/camera.h"
#include "capture/cameras/camera_worker.h"
#include "capture/segmentation/background.h"
#include "capture/sync/pulse_times.h"
#include "daemon/bus/bus.h"
#include "daemon/node/persisted_command.h"
#include "trigger/pulse_generator.h"
#include "wire/messages.h"

namespace v3d::captured {

// The cameras of one capture node.

/// One thread, except for pulse_at().
class NodeCameras {
 public:
  /// Queue length of each camera: more than 1 s of frames, as long as a disk may stall.
  static constexpr size_t kQueueFrames = 32;
  using Workers = std::vector<std::unique_ptr<capture::CameraWorker>>;
  using MakeCamera = std::function<std::unique_ptr<capture::Camera>(const StudioCamera&)>;

  /// Opens the cameras of `node` in the background. `studio` and `pulses` outlive this object.
  NodeCameras(const Studio& studio, const std::string& node, const capture::PulseTimes& pulses);
  /// The same with other cameras: `make` makes one, on its thread.
  NodeCameras(const Studio& studio, const std::string& node, const MakeCamera& make);
  ~NodeCameras();
  NodeCameras(const NodeCameras&) = delete;
  NodeCameras& operator=(const NodeCameras&) = delete;

  Workers::const_iterator begin() const { return workers_.begin(); }
  Workers::const_iterator end() const { return workers_.end(); }
  size_t size() const { return workers_.size(); }

  /// These four call the function of the same name of every CameraWorker.
  void arm(Duration period, bool edges_are_reported);
  void pulse_at(const capture::PulseEdge& edge);  ///< any thread
  void train_ended();
  void disarm();

  /// The cameras in state kReady, in the order of the studio file.
  std::vector<capture::CameraWorker*> ready() const;
  /// A camera is settling: it becomes ready within a few periods, or is lost.
  bool are_settling() const;
  /// The required cameras that are not ready, each with its reason, on one line; else empty.
  /// Cameras in `may_be_missing` are not required.
  std::string not_ready(const std::vector<std::string>& may_be_missing) const;
  /// Of an action trigger: the ready cameras whose clock is not locked to PTP, one line; else
  /// empty.
  std::string clock_fault() const;
  /// Throws InputError when a camera has no calibration, or a required camera has no background
  /// model.
  void check_prepared(const std::vector<std::string>& may_be_missing) const;
  /// Throws InputError when there is no model, or when it has another image size or pixel format
  /// than the camera.
  segmentation::BackgroundModel background_of(const capture::CameraWorker& worker) const;
  /// The ready cameras and their background models, without cameras in `may_be_missing` that have
  /// no model of their images. Throws InputError when another ready camera has none.
  struct RecordedCamera {
    capture::CameraWorker* worker;
    segmentation::BackgroundModel background;
  };
  std::vector<RecordedCamera> recorded(const std::vector<std::string>& may_be_missing) const;

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

// The studio's trigger as seen by one capture node: its own generator and sense line, or the health
// messages of the node that has them.

/// One thread; the sensor() may be read by another.
class NodeTrigger {
 public:
  /// Touches no hardware. `studio` and `bus` outlive the trigger. Throws InputError when a trigger
  /// setting of the studio file is not supported.
  NodeTrigger(const Studio& studio, const std::string& node, bus::Bus& bus);
  /// A trigger of this node. `sensor`: null without a sense line.
  NodeTrigger(std::unique_ptr<trigger::PulseGenerator> generator,
              std::unique_ptr<trigger::PulseSensor> sensor);

  /// The pulses are generated on this node.
  bool is_here() const { return generator_ != nullptr; }
  /// The sense line of this node; null on other nodes and without a sense line.
  trigger::PulseSensor* sensor() const { return sensor_.get(); }
  /// Health of the trigger's node; null on that node.
  node::TrainMonitor* monitor() const { return monitor_.get(); }
  /// The cameras receive the time of every pulse (CameraWorker::pulse_at).
  bool reports_edges() const { return generator_ || is_sensed_; }

  /// These four call PulseGenerator's functions. On other nodes they do nothing, except that arm()
  /// and start() reset the monitor: its counts are those of an earlier train.
  void arm(const trigger::PulseTrain& train);
  bool armed() { return !generator_ || generator_->armed(); }
  /// Call it between armed() and start(). `fault`: PulseGenerator::set_clock_fault().
  void set_clock_fault(const std::string& fault);
  void start();
  void stop();
  /// After a stop() that failed: tries again, without waiting. Call it once a second.
  void retry_stop() {
    if (generator_) generator_->retry_stop();
  }

  /// Without a sense line: pulse 0 with the time at which it was commanded. Returned once per
  /// train, and on the trigger's node only.
  std::optional<capture::PulseEdge> unsensed_first_pulse();
  /// Without a sense line, where this host paces the pulses: those after pulse 0 that were
  /// commanded since the last call.
  std::vector<capture::PulseEdge> unsensed_pulses();
  /// On other nodes: reads the health messages that have arrived. Call it often. `take`: the take
  /// being recorded.
  void poll(const std::string& take);
  /// Calls poll(). True when this node has received or sensed the end of the train.
  bool train_has_ended(const std::string& take);

  /// The generator does not count pulses exactly, but the sense line does.
  bool sensor_count_is_better() const;
  /// Pulses of the train until now. `seen`: pulses that this node has seen, up to the last one. An
  /// estimate where the generator does not count exactly and the sense line misses its last pulses.
  int64_t commanded(int64_t seen) const;
  /// False on another node that has not received the end of the train: more pulses may follow.
  bool end_is_known() const { return generator_ || monitor_->ended(); }

  /// One line each; empty without a fault, and on other nodes.
  std::string fault() const { return generator_ ? generator_->fault() : ""; }
  std::string warning() const { return generator_ ? generator_->warning() : ""; }
  std::string sensor_fault() const { return sensor_ ? sensor_->fault() : ""; }
  /// What health reports: one line each. `in_train`: from ready until the take is closed. Otherwise
  /// only pulses that may continue: the sense line is not open, and events and ledger have reported
  /// the problems of the last train.
  std::vector<std::string> problems(bool in_train) const;
  /// How many pulses of the train the sense line lacks, one line; empty where it lacks none that
  /// are due, and without a sense line. `sensed`: pulses on the line.
  std::string unsensed_warning(int64_t sensed) const;
  /// Adds the statistics of the pulses to `health`; nothing on other nodes.
  void report(wire::HealthMessage& health) const;

 private:
  const bool is_sensed_;
  std::unique_ptr<trigger::PulseGenerator> generator_;  ///< null on other nodes
  std::unique_ptr<trigger::PulseSensor> sensor_;
  std::unique_ptr<node::TrainMonitor> monitor_;
  Duration period_{};  ///< of the train
  bool first_pulse_reported_ = false;
  int64_t next_unsensed_ = 1;  ///< pulse number
};

}  // namespace v3d::captured
