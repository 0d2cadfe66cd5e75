// Trains whose frames are not recorded: background and check.
#pragma once

#include <atomic>
#include <filesystem>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/config/studio_values.h"
#include "capture/cameras/camera_worker.h"
#include "capture/segmentation/image_measures.h"
#include "capture/segmentation/motion_stops.h"
#include "capture/segmentation/segmenter.h"
#include "daemon/bus/bus.h"
#include "daemon/captured/preview.h"
#include "daemon/captured/sound_receiver.h"
#include "daemon/node/service.h"
#include "take/ledger/ledger.h"

namespace v3d::captured {

// Learns the background model of every camera from images of the empty studio.

struct BackgroundPlan {
  int64_t plates = 16;                      ///< images per camera
  Duration limit{};                         ///< maximum time to collect the plates
  std::filesystem::path folder;             ///< where the models are saved; created if missing
  double rate_hz = 0;                       ///< of the pulses
  std::map<std::string, ChromaKey> keys{};  ///< by camera; a camera may be absent
};

/// Collects plates from all cameras, then computes and saves one model for each. Works in a thread
/// of its own, from construction. A camera that delivers less than half of its plates, or fewer
/// than two, is an error.
class BackgroundLearner {
 public:
  struct Result {
    bool succeeded = false;
    std::string text;  ///< one line for the operator
  };

  /// The workers are armed; they and `bus` outlive the learner. Sends previews of the plates.
  BackgroundLearner(std::vector<capture::CameraWorker*> workers, BackgroundPlan plan,
                    bus::Bus& bus);
  /// Stops and waits for the thread.
  ~BackgroundLearner();
  BackgroundLearner(const BackgroundLearner&) = delete;
  BackgroundLearner& operator=(const BackgroundLearner&) = delete;

  /// The last pulse was sent: stop waiting 1 s after the last frame. Any thread.
  void train_ended() { train_ended_ = true; }
  /// The result, once, when the thread has finished; else empty.
  std::optional<Result> poll();
  bool progressed_since(MonotonicInstant since) const { return heartbeat_.beat_since(since); }

 private:
  Result run();
  std::vector<std::vector<Image>> collect_plates();
  /// Appends the next plate of a camera. False if none arrives.
  bool take_plate(size_t index, std::vector<Image>& plates);
  void save_model(const capture::CameraWorker& worker, const std::vector<Image>& plates);

  const std::vector<capture::CameraWorker*> workers_;
  const BackgroundPlan plan_;
  std::vector<PreviewSender> previews_;  ///< one per worker, same order
  MonotonicInstant last_frame_;          ///< the learner's thread only
  node::Heartbeat heartbeat_;
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> train_ended_ = false;
  std::future<Result> result_;
};

// Camera check (v3dctl check): receives the frames of a short train, records nothing, and measures
// image quality and pulse numbers of each camera.

/// Result for one camera.
struct CheckedCamera {
  take::CameraLedger pulses;  ///< received, missing, duplicate and suspect; written is 0
  int64_t dropped = 0;        ///< missing frames that this node was too slow to examine
  segmentation::PictureQuality quality;
  std::optional<double> plates_focus;  ///< of the background plates; empty without a matching model
  std::optional<double> foreground;    ///< mean share of the image, 0 to 1; empty without a model
  std::optional<segmentation::Flicker> flicker;  ///< of the lamps; empty under steady light
  std::optional<double> rate_without_flicker;    ///< of pulses, Hz; empty if none is known
  std::vector<segmentation::MotionStop> motion_stops;
};

/// Takes frames from its workers, each in a thread of its own, from construction, and sends
/// previews of them. Works without a background model, too.
class CameraCheck {
 public:
  struct Setup {
    double rate_hz = 0;                ///< of the pulses
    std::filesystem::path background;  ///< folder of the background models; may be empty
    /// Longest time to examine the frames that wait at the end of the check.
    Duration backlog_time = std::chrono::seconds(2);
  };
  /// The workers are armed; they and `bus` outlive the check.
  CameraCheck(const std::vector<capture::CameraWorker*>& workers, const Setup& setup,
              bus::Bus& bus);
  ~CameraCheck();
  CameraCheck(const CameraCheck&) = delete;
  CameraCheck& operator=(const CameraCheck&) = delete;

  bool examines(const std::string& camera) const;
  /// True when every camera has delivered certain frames of `pulses` pulses. Any thread.
  bool has_received(int64_t pulses) const;
  bool progressed_since(MonotonicInstant since) const;

  /// Examines the frames that have arrived, and stops the threads. `commanded`: pulses of the
  /// train.
  std::vector<CheckedCamera> close(int64_t commanded);

 private:
  class CheckedWorker;

  const double rate_hz_;
  std::vector<std::unique_ptr<CheckedWorker>> workers_;
};

/// What a node found in a check.
struct CheckResult {
  const take::Ledger& ledger;
  double rate_hz;  ///< of the pulses
  const std::vector<CheckedCamera>& cameras;
  const std::vector<std::string>& not_ready;
  const std::optional<CheckedSound>& sound;  ///< empty: the node has no sound input
};

/// JSON of a check for the detail of a reply: pulses {commanded, sensed, rate_hz}, checked [{name,
/// received, missing, missing_count, dropped, duplicate, duplicate_count, suspect, suspect_count,
/// clipped, dark, mean_grey, focus, plates_focus, foreground, flicker_amplitude, beat_hz,
/// rate_without_flicker_hz, motion_stops [[pulse, change]]}], not_ready [names], sound {fault,
/// clap_pulse, uncertainty_us} or null. The lists of pulses are cut off after the first 100.
std::string check_json(const CheckResult& result);

}  // namespace v3d::captured
