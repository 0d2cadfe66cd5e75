// Learns the background model of every camera from images of the empty studio.
#pragma once

#include <atomic>
#include <filesystem>
#include <future>
#include <map>
#include <string>
#include <vector>

#include "base/config/chroma_key.h"
#include "capture/cameras/camera_worker.h"
#include "daemon/captured/preview_sender.h"
#include "daemon/node/heartbeat.h"

namespace v3d {

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
  BackgroundLearner(std::vector<CameraWorker*> workers, BackgroundPlan plan, Bus& bus);
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
  void take_plate(size_t index, std::vector<Image>& plates);
  void save_model(const CameraWorker& worker, const std::vector<Image>& plates);

  const std::vector<CameraWorker*> workers_;
  const BackgroundPlan plan_;
  std::vector<PreviewSender> previews_;  ///< one per worker, same order
  MonotonicInstant last_frame_;          ///< the learner's thread only
  Heartbeat heartbeat_;
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> train_ended_ = false;
  std::future<Result> result_;
};

}  // namespace v3d
