#include "daemon/captured/background_learner.h"

#include <algorithm>

#include "capture/segmentation/segmenter.h"

namespace v3d {
namespace {

constexpr Duration kLook = std::chrono::milliseconds(20);
/// After the last pulse: longer than a frame is on its way.
constexpr Duration kLastFrames = std::chrono::seconds(1);
/// Fewer plates than this part of what was asked for is a camera in trouble.
constexpr double kEnough = 0.5;

}  // namespace

BackgroundLearner::BackgroundLearner(std::vector<CameraWorker*> workers, LearnPlan plan, Bus& bus)
    : workers_(std::move(workers)), plan_(std::move(plan)) {
  for (const CameraWorker* worker : workers_) {
    previews_.emplace_back(bus, worker->camera(), plan_.rate_hz);
  }
  result_ = std::async(std::launch::async, [this] { return run(); });
}

BackgroundLearner::~BackgroundLearner() {
  stopping_ = true;
  if (result_.valid()) result_.wait();
}

std::optional<BackgroundLearner::Result> BackgroundLearner::poll() {
  const bool finished =
      result_.valid() && result_.wait_for(Duration::zero()) == std::future_status::ready;
  if (!finished) return std::nullopt;
  return result_.get();
}

std::vector<std::vector<Image>> BackgroundLearner::gather() {
  const MonotonicInstant end = Monotonic::now() + plan_.limit;
  const auto wanted = static_cast<size_t>(plan_.plates);
  std::vector<std::vector<Image>> plates(workers_.size());
  const auto whole = [&] {
    return std::all_of(plates.begin(), plates.end(),
                       [&](const auto& p) { return p.size() >= wanted; });
  };
  MonotonicInstant last_frame = Monotonic::now();
  const auto none_comes = [&] {
    const MonotonicInstant now = Monotonic::now();
    return now > end || (train_ended_ && now - last_frame > kLastFrames);
  };
  while (!stopping_ && !whole() && !none_comes()) {
    heartbeat_.beat();
    for (size_t i = 0; i < workers_.size(); ++i) {
      if (plates[i].size() >= wanted) continue;
      // All cameras see a pulse at once: waiting for one is waiting for all.
      if (auto frame = workers_[i]->take(Monotonic::now() + kLook)) {
        if (const int64_t pulse = frame->label.pulse; previews_[i].wants(pulse)) {
          previews_[i].send(pulse, frame->image.view(), nullptr);
        }
        plates[i].push_back(std::move(frame->image));
        last_frame = Monotonic::now();
        // It has what it came for: that nothing follows is no loss.
        if (plates[i].size() == wanted) workers_[i]->train_ended();
      }
    }
  }
  return plates;
}

BackgroundLearner::Result BackgroundLearner::run() try {
  std::vector<std::vector<Image>> plates = gather();
  if (stopping_) return {.learnt = false, .text = "stopped"};
  for (size_t i = 0; i < workers_.size(); ++i) {
    const std::string& camera = workers_[i]->camera();
    const size_t enough = std::max<size_t>(2, static_cast<size_t>(kEnough * plan_.plates));
    if (plates[i].size() < enough) {
      return {.learnt = false,
              .text = camera + ": only " + std::to_string(plates[i].size()) + " of " +
                      std::to_string(plan_.plates) + " plates arrived"};
    }
  }
  std::filesystem::create_directories(plan_.folder);
  for (size_t i = 0; i < workers_.size(); ++i) {
    heartbeat_.beat();
    std::vector<ImageView> views;
    for (const Image& plate : plates[i]) views.push_back(plate.view());
    const std::string& camera = workers_[i]->camera();
    BackgroundModel model = learn_background(views);
    if (const auto key = plan_.keys.find(camera); key != plan_.keys.end()) model.key = key->second;
    save_background(plan_.folder, camera, model);
    plates[i].clear();
  }
  return {.learnt = true,
          .text = "learnt the background of " + std::to_string(workers_.size()) + " cameras"};
} catch (const std::exception& error) {
  return {.learnt = false, .text = error.what()};
}

}  // namespace v3d
