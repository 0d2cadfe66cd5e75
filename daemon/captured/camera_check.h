// Camera check (v3dctl check): receives the frames of a short train, records nothing, and measures
// image quality and pulse numbers of each camera.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "capture/cameras/camera_worker.h"
#include "capture/segmentation/picture_quality.h"
#include "capture/segmentation/segmenter.h"
#include "daemon/bus/bus.h"
#include "daemon/captured/preview_sender.h"
#include "daemon/node/heartbeat.h"
#include "take/ledger/ledger.h"

namespace v3d {

/// Result for one camera.
struct CheckedCamera {
  CameraLedger pulses;  ///< received, missing, duplicate and suspect; written is 0
  PictureQuality quality;
  std::optional<double> plates_focus;  ///< of the background plates; empty without a matching model
  std::optional<double> foreground;    ///< mean share of the image, 0 to 1; empty without a model
};

/// Takes frames from its workers in a thread of its own, from construction, and sends previews of
/// them. Works without a background model, too.
class CameraCheck {
 public:
  struct Setup {
    double rate_hz = 0;                ///< of the pulses
    std::filesystem::path background;  ///< folder of the background models; may be empty
  };
  /// The workers are armed; they and `bus` outlive the check.
  CameraCheck(const std::vector<CameraWorker*>& workers, const Setup& setup, Bus& bus);
  ~CameraCheck();
  CameraCheck(const CameraCheck&) = delete;
  CameraCheck& operator=(const CameraCheck&) = delete;

  /// True when every camera has delivered `frames` frames. Any thread.
  bool has_received(int64_t frames) const;
  bool progressed_since(MonotonicInstant since) const {
    return workers_.empty() || heartbeat_.beat_since(since);
  }

  /// Stops the thread. `commanded`: pulses of the train.
  std::vector<CheckedCamera> close(int64_t commanded);

 private:
  struct CheckedWorker;
  void run();
  static void examine(CheckedWorker& checked, const Frame& frame);
  void stop_thread();

  std::vector<std::unique_ptr<CheckedWorker>> workers_;
  Heartbeat heartbeat_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;  ///< not started without workers
};

/// JSON of a check for the detail of a reply: pulses {commanded, sensed}, checked [{name, received,
/// missing, duplicate, suspect, clipped, dark, mean_grey, focus, plates_focus, foreground}],
/// not_ready [names].
std::string check_json(const Ledger& ledger, const std::vector<CheckedCamera>& cameras,
                       const std::vector<std::string>& not_ready);

}  // namespace v3d
