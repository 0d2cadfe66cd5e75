#include "daemon/captured/camera_check.h"

#include <algorithm>

#include "base/error.h"

namespace v3d {
namespace {

constexpr Duration kLook = std::chrono::milliseconds(20);

/// A check must also work where nothing has been learnt yet.
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
struct CameraCheck::Seat {
  Seat(CameraWorker& camera_worker, const Setup& setup, Bus& bus)
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
  // The thread's own until it has ended:
  PictureStatistics pictures;
  double foreground = 0;  ///< pixels of all pictures, in parts of a picture
  std::vector<int64_t> pulses;
  std::vector<int64_t> suspect;
  std::atomic<int64_t> received = 0;
};

CameraCheck::CameraCheck(const std::vector<CameraWorker*>& workers, const Setup& setup, Bus& bus) {
  for (CameraWorker* worker : workers) {
    seats_.push_back(std::make_unique<Seat>(*worker, setup, bus));
  }
  if (!seats_.empty()) thread_ = std::thread([this] { run(); });
}

CameraCheck::~CameraCheck() { end(); }

void CameraCheck::end() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void CameraCheck::run() {
  while (!stopping_) {
    heartbeat_.beat();
    // All cameras see a pulse at once: waiting for one is waiting for all.
    const MonotonicInstant until = Monotonic::now() + kLook;
    for (const auto& seat : seats_) {
      while (const auto frame = seat->worker.take(until)) {
        look_at(*seat, *frame);
        ++seat->received;
      }
    }
  }
}

void CameraCheck::look_at(Seat& seat, const Frame& frame) {
  const ImageView image = frame.image.view();
  seat.pictures.add(image);
  seat.pulses.push_back(frame.label.pulse);
  if (frame.label.suspect) seat.suspect.push_back(frame.label.pulse);
  std::optional<Mask> mask;
  if (seat.segmenter && image.size == seat.segmenter->size() &&
      image.format == seat.segmenter->format()) {
    mask = seat.segmenter->segment(image);
    seat.foreground +=
        static_cast<double>(mask->count()) / static_cast<double>(image.size.pixels());
  }
  if (seat.preview.wants(frame.label.pulse)) {
    seat.preview.send(frame.label.pulse, image, mask ? &*mask : nullptr);
  }
}

bool CameraCheck::has(int64_t frames) const {
  return std::all_of(seats_.begin(), seats_.end(),
                     [&](const auto& seat) { return seat->received >= frames; });
}

std::vector<CheckedCamera> CameraCheck::close(int64_t commanded) {
  end();
  std::vector<CheckedCamera> cameras;
  for (const auto& seat : seats_) {
    CheckedCamera camera;
    camera.pulses = account(seat->worker.camera(), seat->pulses, seat->suspect, commanded);
    camera.pulses.received = seat->received;
    camera.quality = seat->pictures.result();
    camera.plates_focus = seat->plates_focus;
    if (seat->segmenter && seat->pictures.pictures() > 0) {
      camera.foreground = seat->foreground / static_cast<double>(seat->pictures.pictures());
    }
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

}  // namespace v3d
