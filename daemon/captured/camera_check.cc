#include "daemon/captured/camera_check.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/core/error.h"

namespace v3d {
namespace {

constexpr Duration kCheckPollInterval = std::chrono::milliseconds(20);

/// Empty when there is no model yet, or it does not match the camera: a check works without one.
std::optional<BackgroundModel> background_of(const CameraWorker& worker,
                                             const std::filesystem::path& folder) {
  if (!has_background(folder, worker.camera())) return std::nullopt;
  try {
    BackgroundModel model = load_background(folder, worker.camera());
    const CameraWorkerStatus status = worker.status();
    if (model.size != status.size || model.format != status.format) return std::nullopt;
    return model;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace

/// One camera of the check.
struct CameraCheck::CheckedWorker {
  CheckedWorker(CameraWorker& camera_worker, const Setup& setup, Bus& bus)
      : worker(camera_worker), preview(bus, camera_worker.camera(), setup.rate_hz) {
    const auto model = background_of(worker, setup.background);
    if (!model) return;
    segmenter.emplace(*model, SegmentOptions{});
    plates_focus = focus_of(*model);
  }

  CameraWorker& worker;
  PreviewSender preview;
  std::optional<Segmenter> segmenter;
  std::optional<double> plates_focus;
  // The members below belong to the thread until it has ended, except `received`.
  PictureStatistics pictures;
  double foreground = 0;  ///< sum over all images of the foreground share, 0 to 1 each
  std::vector<int64_t> pulses;
  std::vector<int64_t> suspect;
  std::atomic<int64_t> received = 0;
};

CameraCheck::CameraCheck(const std::vector<CameraWorker*>& workers, const Setup& setup, Bus& bus) {
  for (CameraWorker* worker : workers) {
    workers_.push_back(std::make_unique<CheckedWorker>(*worker, setup, bus));
  }
  if (!workers_.empty()) thread_ = std::thread([this] { run(); });
}

CameraCheck::~CameraCheck() { stop_thread(); }

void CameraCheck::stop_thread() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void CameraCheck::run() {
  while (!stopping_) {
    heartbeat_.beat();
    // All cameras expose at the same time, so waiting for them in turn costs no time.
    const MonotonicInstant until = Monotonic::now() + kCheckPollInterval;
    for (const auto& checked : workers_) {
      while (const auto frame = checked->worker.take(until)) {
        examine(*checked, *frame);
        ++checked->received;
      }
    }
  }
}

void CameraCheck::examine(CheckedWorker& checked, const Frame& frame) {
  const ImageView image = frame.image.view();
  checked.pictures.add(image);
  checked.pulses.push_back(frame.label.pulse);
  if (frame.label.suspect) checked.suspect.push_back(frame.label.pulse);
  std::optional<Mask> mask;
  if (checked.segmenter && image.size == checked.segmenter->size() &&
      image.format == checked.segmenter->format()) {
    mask = checked.segmenter->segment(image);
    checked.foreground +=
        static_cast<double>(mask->count()) / static_cast<double>(image.size.pixels());
  }
  if (checked.preview.wants(frame.label.pulse)) {
    checked.preview.send(frame.label.pulse, image, mask ? &*mask : nullptr);
  }
}

bool CameraCheck::has_received(int64_t frames) const {
  return std::all_of(workers_.begin(), workers_.end(),
                     [&](const auto& checked) { return checked->received >= frames; });
}

std::vector<CheckedCamera> CameraCheck::close(int64_t commanded) {
  stop_thread();
  std::vector<CheckedCamera> cameras;
  for (const auto& checked : workers_) {
    CheckedCamera camera;
    camera.pulses = account(checked->worker.camera(), checked->pulses, checked->suspect, commanded);
    camera.pulses.received = checked->received;
    camera.quality = checked->pictures.result();
    camera.plates_focus = checked->plates_focus;
    if (checked->segmenter && checked->pictures.pictures() > 0) {
      camera.foreground = checked->foreground / static_cast<double>(checked->pictures.pictures());
    }
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

std::string check_json(const Ledger& ledger, const std::vector<CheckedCamera>& cameras,
                       const std::vector<std::string>& not_ready) {
  const auto value_or_null = [](const auto& value) {
    return value ? nlohmann::json(*value) : nlohmann::json();
  };
  nlohmann::json checked = nlohmann::json::array();
  for (const CheckedCamera& c : cameras) {
    checked.push_back({{"name", c.pulses.name},
                       {"received", c.pulses.received},
                       {"missing", c.pulses.missing},
                       {"duplicate", c.pulses.duplicate},
                       {"suspect", c.pulses.suspect},
                       {"clipped", c.quality.clipped},
                       {"dark", c.quality.dark},
                       {"mean_grey", c.quality.mean_grey},
                       {"focus", c.quality.focus},
                       {"plates_focus", value_or_null(c.plates_focus)},
                       {"foreground", value_or_null(c.foreground)}});
  }
  const nlohmann::json json = {
      {"pulses", {{"commanded", ledger.commanded}, {"sensed", value_or_null(ledger.sensed)}}},
      {"checked", checked},
      {"not_ready", not_ready}};
  return json.dump();
}

}  // namespace v3d
