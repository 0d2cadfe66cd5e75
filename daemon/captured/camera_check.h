// The cameras of a node looked at before a take: pulses are fired and nothing is recorded.
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

/// What was seen of one camera.
struct CheckedCamera {
  CameraLedger pulses;  ///< received, missing, duplicate and suspect; nothing was written
  PictureQuality quality;
  std::optional<double> plates_focus;  ///< of the background's plates, where they are of this size
  std::optional<double> foreground;    ///< mean share of the pictures; empty without a background
};

/// Takes the frames from its workers from the moment it is made, in a thread of its own, and sends
/// previews of them.
class CameraCheck {
 public:
  struct Setup {
    double rate_hz = 0;
    std::filesystem::path background;  ///< the plates, where there are any
  };
  /// The workers are armed; they and `bus` outlive the check.
  CameraCheck(const std::vector<CameraWorker*>& workers, const Setup& setup, Bus& bus);
  ~CameraCheck();
  CameraCheck(const CameraCheck&) = delete;
  CameraCheck& operator=(const CameraCheck&) = delete;

  /// Every camera has given so many frames.
  bool has(int64_t frames) const;
  bool progressed_since(MonotonicInstant since) const {
    return seats_.empty() || heartbeat_.since(since);
  }

  /// Ends the thread and gives the account.
  std::vector<CheckedCamera> close(int64_t commanded);

 private:
  struct Seat;
  void run();
  static void look_at(Seat& seat, const Frame& frame);
  void end();

  std::vector<std::unique_ptr<Seat>> seats_;
  Heartbeat heartbeat_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;  ///< none where there is no camera to wait for
};

}  // namespace v3d
