#include "daemon/captured/unrecorded_trains.h"

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>

#include "base/core/error.h"
#include "capture/segmentation/image_measures.h"
#include "capture/segmentation/segmenter.h"

namespace v3d::captured {
namespace {

constexpr Duration kPollInterval = std::chrono::milliseconds(20);
/// After the last pulse. Longer than the latency of a frame.
constexpr Duration kFrameTimeout = std::chrono::seconds(1);
/// A camera that delivers a smaller share of its plates is faulty.
constexpr double kMinPlateShare = 0.5;

}  // namespace

BackgroundLearner::BackgroundLearner(std::vector<capture::CameraWorker*> workers,
                                     BackgroundPlan plan, bus::Bus& bus)
    : workers_(std::move(workers)), plan_(std::move(plan)) {
  for (const capture::CameraWorker* worker : workers_) {
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
  // A process that was stopped for long takes the frames that wait.
  for (bool may_wait = true; !stopping_ && !is_complete() && (may_wait || !timed_out());) {
    heartbeat_.beat();
    may_wait = false;
    for (size_t i = 0; i < workers_.size(); ++i) {
      if (plates[i].size() < wanted && take_plate(i, plates[i])) may_wait = true;
    }
  }
  return plates;
}

bool BackgroundLearner::take_plate(size_t index, std::vector<Image>& plates) {
  capture::CameraWorker& worker = *workers_[index];
  // All cameras expose at the same time, so waiting for them in turn costs no time.
  auto frame = worker.pop(Monotonic::now() + kPollInterval);
  if (!frame) return false;
  reduce_to_8_bits(frame->image);
  PreviewSender& preview = previews_[index];
  if (const int64_t pulse = frame->label.pulse; preview.is_due(pulse)) {
    preview.send(pulse, frame->image.view(), nullptr);
  }
  plates.push_back(std::move(frame->image));
  last_frame_ = Monotonic::now();
  // This camera is done: missing frames from here on are no loss.
  if (plates.size() == static_cast<size_t>(plan_.plates)) worker.train_ended();
  return true;
}

void BackgroundLearner::save_model(const capture::CameraWorker& worker,
                                   const std::vector<Image>& plates) {
  std::vector<ImageView> views;
  for (const Image& plate : plates) views.push_back(plate.view());
  const std::string& camera = worker.camera();
  segmentation::BackgroundModel model = segmentation::learn_background(views);
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

namespace {

constexpr Duration kCheckPollInterval = std::chrono::milliseconds(20);

/// Empty when there is no model yet, or it does not match the camera: a check works without one.
std::optional<segmentation::BackgroundModel> background_of(const capture::CameraWorker& worker,
                                                           const std::filesystem::path& folder) {
  if (!segmentation::has_background(folder, worker.camera())) return std::nullopt;
  try {
    segmentation::BackgroundModel model = segmentation::load_background(folder, worker.camera());
    const capture::CameraWorkerStatus status = worker.status();
    if (model.size != status.size || model.format != reduced_to_8_bits(status.format)) {
      return std::nullopt;
    }
    return model;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace

/// One camera of the check.
class CameraCheck::CheckedWorker {
 public:
  CheckedWorker(capture::CameraWorker& camera_worker, const Setup& setup, bus::Bus& bus)
      : worker_(camera_worker),
        preview_(bus, camera_worker.camera(), setup.rate_hz),
        backlog_time_(setup.backlog_time) {
    if (const auto model = background_of(worker_, setup.background)) {
      segmenter_.emplace(*model, segmentation::SegmentOptions{});
      plates_focus_ = focus_of(*model);
    }
    thread_ = std::thread([this] { run(); });
  }
  ~CheckedWorker() { stop(); }
  CheckedWorker(const CheckedWorker&) = delete;
  CheckedWorker& operator=(const CheckedWorker&) = delete;

  const std::string& camera() const { return worker_.camera(); }
  int64_t certain() const { return certain_; }
  bool progressed_since(MonotonicInstant since) const { return heartbeat_.beat_since(since); }
  /// The frames that have arrived are still examined.
  void request_end() { stopping_ = true; }
  CheckedCamera close(int64_t commanded, double rate_hz);

 private:
  void run();
  void examine(const Frame& frame);
  void stop() {
    request_end();
    if (thread_.joinable()) thread_.join();
  }

  capture::CameraWorker& worker_;
  PreviewSender preview_;
  const Duration backlog_time_;
  std::optional<segmentation::Segmenter> segmenter_;
  std::optional<double> plates_focus_;
  // The members below belong to the thread until it has ended, except the atomic ones.
  segmentation::PictureStatistics pictures_;
  double foreground_ = 0;  ///< sum over all images of the foreground share, 0 to 1 each
  take::CameraAccount account_;
  take::PulseSet certain_pulses_;
  std::vector<segmentation::PulseBrightness> brightness_;
  segmentation::MotionSeries motion_;
  std::atomic<int64_t> certain_ = 0;  ///< pulses with a frame that is not suspect
  node::Heartbeat heartbeat_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

void CameraCheck::CheckedWorker::run() {
  // A free-running camera has always a next frame.
  std::optional<MonotonicInstant> end;
  while (!end || Monotonic::now() < *end) {
    heartbeat_.beat();
    if (stopping_ && !end) end = Monotonic::now() + backlog_time_;
    auto frame = worker_.pop(Monotonic::now() + (end ? Duration::zero() : kCheckPollInterval));
    if (!frame && end) return;
    if (!frame) continue;
    reduce_to_8_bits(frame->image);
    examine(*frame);
    certain_ = certain_pulses_.size();
  }
}

void CameraCheck::CheckedWorker::examine(const Frame& frame) {
  const ImageView image = frame.image.view();
  const double grey = pictures_.add(image);
  account_.add(frame.label.pulse, frame.label.suspect);
  if (!frame.label.suspect) {
    certain_pulses_.insert(frame.label.pulse);
    brightness_.push_back({frame.label.pulse, grey});
    motion_.add(frame.label.pulse, image);
  }
  std::optional<Mask> mask;
  if (segmenter_ && image.size == segmenter_->size() && image.format == segmenter_->format()) {
    mask = segmenter_->segment(image);
    foreground_ += static_cast<double>(mask->count()) / static_cast<double>(image.size.pixels());
  }
  if (preview_.is_due(frame.label.pulse)) {
    preview_.send(frame.label.pulse, image, mask ? &*mask : nullptr);
  }
}

CameraCheck::CameraCheck(const std::vector<capture::CameraWorker*>& workers, const Setup& setup,
                         bus::Bus& bus)
    : rate_hz_(setup.rate_hz) {
  for (capture::CameraWorker* worker : workers) {
    workers_.push_back(std::make_unique<CheckedWorker>(*worker, setup, bus));
  }
}

CameraCheck::~CameraCheck() = default;

bool CameraCheck::progressed_since(MonotonicInstant since) const {
  return std::ranges::all_of(workers_,
                             [&](const auto& checked) { return checked->progressed_since(since); });
}

bool CameraCheck::examines(const std::string& camera) const {
  return std::ranges::any_of(workers_,
                             [&](const auto& checked) { return checked->camera() == camera; });
}

bool CameraCheck::has_received(int64_t pulses) const {
  return std::ranges::all_of(workers_,
                             [&](const auto& checked) { return checked->certain() >= pulses; });
}

namespace {

void add_flicker(const std::vector<segmentation::PulseBrightness>& brightness, double rate_hz,
                 CheckedCamera& camera) {
  camera.flicker = segmentation::measure_flicker(brightness, rate_hz);
  if (!camera.flicker) return;
  // A beat is known to half of the resolution of the series.
  const size_t length = std::min(brightness.size(), segmentation::kMaxFlickerPictures);
  const double tolerance_hz = rate_hz / (2 * static_cast<double>(length));
  camera.rate_without_flicker =
      segmentation::rate_without_flicker(camera.flicker->beat_hz, rate_hz, tolerance_hz);
}

}  // namespace

CheckedCamera CameraCheck::CheckedWorker::close(int64_t commanded, double rate_hz) {
  stop();
  CheckedCamera camera;
  camera.pulses = account_.ledger(worker_.camera(), commanded);
  camera.dropped = worker_.status().dropped + worker_.waiting();  // not examined in backlog_time_
  camera.quality = pictures_.result();
  camera.plates_focus = plates_focus_;
  if (segmenter_ && pictures_.pictures() > 0) {
    camera.foreground = foreground_ / static_cast<double>(pictures_.pictures());
  }
  add_flicker(brightness_, rate_hz, camera);
  camera.motion_stops = motion_.stops(rate_hz);
  return camera;
}

std::vector<CheckedCamera> CameraCheck::close(int64_t commanded) {
  for (const auto& checked : workers_) checked->request_end();
  std::vector<CheckedCamera> cameras;
  for (const auto& checked : workers_) cameras.push_back(checked->close(commanded, rate_hz_));
  return cameras;
}

namespace {

nlohmann::json stops_json(const std::vector<segmentation::MotionStop>& stops) {
  nlohmann::json json = nlohmann::json::array();
  for (const segmentation::MotionStop& stop : stops) json.push_back({stop.pulse, stop.change});
  return json;
}

/// The first numbers of a list: a check of many pulses without frames would not fit a reply. The
/// field with "_count" at its end has the length.
nlohmann::json first_of(const std::vector<int64_t>& pulses) {
  constexpr size_t kMaxListed = 100;
  return std::vector<int64_t>(pulses.begin(), pulses.begin() + static_cast<std::ptrdiff_t>(std::min(
                                                                   kMaxListed, pulses.size())));
}

}  // namespace

std::string check_json(const CheckResult& result) {
  const auto value_or_null = [](const auto& value) {
    return value ? nlohmann::json(*value) : nlohmann::json();
  };
  nlohmann::json checked = nlohmann::json::array();
  for (const CheckedCamera& c : result.cameras) {
    checked.push_back({{"name", c.pulses.name},
                       {"received", c.pulses.received},
                       {"missing", first_of(c.pulses.missing)},
                       {"missing_count", c.pulses.missing.size()},
                       {"dropped", c.dropped},
                       {"duplicate", first_of(c.pulses.duplicate)},
                       {"duplicate_count", c.pulses.duplicate.size()},
                       {"suspect", first_of(c.pulses.suspect)},
                       {"suspect_count", c.pulses.suspect.size()},
                       {"clipped", c.quality.clipped},
                       {"dark", c.quality.dark},
                       {"mean_grey", c.quality.mean_grey},
                       {"focus", c.quality.focus},
                       {"plates_focus", value_or_null(c.plates_focus)},
                       {"foreground", value_or_null(c.foreground)},
                       {"flicker_amplitude", c.flicker ? c.flicker->amplitude : 0.0},
                       {"beat_hz", c.flicker ? nlohmann::json(c.flicker->beat_hz) : nullptr},
                       {"rate_without_flicker_hz", value_or_null(c.rate_without_flicker)},
                       {"motion_stops", stops_json(c.motion_stops)}});
  }
  nlohmann::json sound;
  if (result.sound) {
    sound = {{"fault", result.sound->fault},
             {"clap_pulse", value_or_null(result.sound->clap_pulse)},
             {"uncertainty_us", 1e6 * result.sound->uncertainty_s}};
  }
  const nlohmann::json json = {{"pulses",
                                {{"commanded", result.ledger.commanded},
                                 {"sensed", value_or_null(result.ledger.sensed)},
                                 {"rate_hz", result.rate_hz}}},
                               {"checked", checked},
                               {"not_ready", result.not_ready},
                               {"sound", sound}};
  return json.dump();
}

}  // namespace v3d::captured
