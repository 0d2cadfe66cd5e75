#include "daemon/captured/background_learner.h"

#include <algorithm>

#include "capture/segmentation/segmenter.h"

namespace v3d {
namespace {

constexpr Duration kPollInterval = std::chrono::milliseconds(20);
/// After the last pulse. Longer than the latency of a frame.
constexpr Duration kFrameTimeout = std::chrono::seconds(1);
/// A camera that delivers a smaller share of its plates is faulty.
constexpr double kMinPlateShare = 0.5;

}  // namespace

BackgroundLearner::BackgroundLearner(std::vector<CameraWorker*> workers, BackgroundPlan plan,
                                     Bus& bus)
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

std::vector<std::vector<Image>> BackgroundLearner::collect_plates() {
  const MonotonicInstant end = Monotonic::now() + plan_.limit;
  const auto wanted = static_cast<size_t>(plan_.plates);
  std::vector<std::vector<Image>> plates(workers_.size());
  const auto is_complete = [&] {
    return std::all_of(plates.begin(), plates.end(),
                       [&](const auto& p) { return p.size() >= wanted; });
  };
  last_frame_ = Monotonic::now();
  const auto timed_out = [&] {
    const MonotonicInstant now = Monotonic::now();
    return now > end || (train_ended_ && now - last_frame_ > kFrameTimeout);
  };
  while (!stopping_ && !is_complete() && !timed_out()) {
    heartbeat_.beat();
    for (size_t i = 0; i < workers_.size(); ++i) {
      if (plates[i].size() < wanted) take_plate(i, plates[i]);
    }
  }
  return plates;
}

void BackgroundLearner::take_plate(size_t index, std::vector<Image>& plates) {
  CameraWorker& worker = *workers_[index];
  // All cameras expose at the same time, so waiting for them in turn costs no time.
  auto frame = worker.take(Monotonic::now() + kPollInterval);
  if (!frame) return;
  PreviewSender& preview = previews_[index];
  if (const int64_t pulse = frame->label.pulse; preview.wants(pulse)) {
    preview.send(pulse, frame->image.view(), nullptr);
  }
  plates.push_back(std::move(frame->image));
  last_frame_ = Monotonic::now();
  // This camera is done: missing frames from here on are no loss.
  if (plates.size() == static_cast<size_t>(plan_.plates)) worker.train_ended();
}

void BackgroundLearner::save_model(const CameraWorker& worker, const std::vector<Image>& plates) {
  std::vector<ImageView> views;
  for (const Image& plate : plates) views.push_back(plate.view());
  const std::string& camera = worker.camera();
  BackgroundModel model = learn_background(views);
  if (const auto key = plan_.keys.find(camera); key != plan_.keys.end()) model.key = key->second;
  save_background(plan_.folder, camera, model);
}

BackgroundLearner::Result BackgroundLearner::run() try {
  std::vector<std::vector<Image>> plates = collect_plates();
  if (stopping_) return {.succeeded = false, .text = "stopped"};
  const size_t enough = std::max<size_t>(2, static_cast<size_t>(kMinPlateShare * plan_.plates));
  for (size_t i = 0; i < workers_.size(); ++i) {
    if (plates[i].size() >= enough) continue;
    return {.succeeded = false,
            .text = workers_[i]->camera() + ": only " + std::to_string(plates[i].size()) + " of " +
                    std::to_string(plan_.plates) + " plates arrived"};
  }
  std::filesystem::create_directories(plan_.folder);
  for (size_t i = 0; i < workers_.size(); ++i) {
    heartbeat_.beat();
    save_model(*workers_[i], plates[i]);
    plates[i].clear();
  }
  return {.succeeded = true,
          .text = "learnt the background of " + std::to_string(workers_.size()) + " cameras"};
} catch (const std::exception& error) {
  return {.succeeded = false, .text = error.what()};
}

}  // namespace v3d
