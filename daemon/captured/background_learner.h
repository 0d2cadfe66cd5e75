// Learns the empty studio: gathers plates of every camera, then makes and saves the models.
#pragma once

#include <atomic>
#include <filesystem>
#include <future>
#include <map>
#include <string>
#include <vector>

#include "base/chroma_key.h"
#include "capture/cameras/camera_worker.h"
#include "daemon/captured/preview_sender.h"
#include "daemon/node/heartbeat.h"

namespace v3d {

struct LearnPlan {
  int64_t plates = 16;  ///< of each camera
  Duration limit{};     ///< gather no longer than this
  std::filesystem::path folder;
  double rate_hz = 0;
  std::map<std::string, ChromaKey> keys{};  ///< by camera; none where it is not said
};

/// Begins at construction, in a thread of its own. The workers are armed and outlive the learner.
class BackgroundLearner {
 public:
  struct Result {
    bool learnt = false;
    std::string text;
  };

  /// Sends previews of the plates; `bus` outlives the learner.
  BackgroundLearner(std::vector<CameraWorker*> workers, LearnPlan plan, Bus& bus);
  ~BackgroundLearner();
  BackgroundLearner(const BackgroundLearner&) = delete;
  BackgroundLearner& operator=(const BackgroundLearner&) = delete;

  /// No pulse comes any more: what has not arrived a moment later never will.
  void train_ended() { train_ended_ = true; }
  /// Empty while it is at work; once otherwise.
  std::optional<Result> poll();
  bool progressed_since(MonotonicInstant since) const { return heartbeat_.since(since); }

 private:
  Result run();
  std::vector<std::vector<Image>> gather();

  const std::vector<CameraWorker*> workers_;
  const LearnPlan plan_;
  std::vector<PreviewSender> previews_;  ///< of the workers, in their order
  Heartbeat heartbeat_;
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> train_ended_ = false;
  std::future<Result> result_;
};

}  // namespace v3d
