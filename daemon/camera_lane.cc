#include "daemon/camera_lane.h"

#include <algorithm>

#include "wire/channels.h"

namespace v3d {
namespace {

constexpr Duration kLook = std::chrono::milliseconds(50);
constexpr int64_t kLiveBacklog = 4;

}  // namespace

CameraLane::CameraLane(CameraWorker& worker, Setup setup, Bus& bus, WorkPlaces& places)
    : worker_(worker),
      bus_(bus),
      places_(places),
      take_(std::move(setup.take)),
      segmenter_(std::move(setup.segmenter)),
      log_(setup.log),
      last_frame_ns_(to_ns(Monotonic::now())) {
  thread_ = std::thread([this] { run(); });
}

CameraLane::~CameraLane() { end(); }

void CameraLane::end() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void CameraLane::run() {
  while (!stopping_) {
    heartbeat_.beat();
    auto frame = worker_.take(Monotonic::now() + kLook);
    if (!frame) continue;
    places_.acquire();
    process(std::move(*frame));
    places_.release();
    last_frame_ns_ = to_ns(Monotonic::now());
    ++received_;  // after the work: who counts received frames sees finished ones
  }
}

void CameraLane::process(Frame frame) {
  FrameMessage message;
  message.sent = Realtime::now();
  message.seq = log_seq_++;
  message.take = take_;
  message.frame = std::move(frame);
  const Frame& raw = message.frame;
  if (log_.write(message)) {
    ++written_;
    written_pulses_.push_back(raw.label.pulse);
    if (raw.label.suspect) suspect_pulses_.push_back(raw.label.pulse);
  } else {
    ++write_errors_;
  }
  if (is_behind()) {
    ++not_live_;
  } else {
    go_live(std::move(message));
  }
}

void CameraLane::go_live(FrameMessage message) {
  const Frame raw = std::move(message.frame);
  const BackgroundModel& model = segmenter_.model();
  if (raw.image.size != model.size || raw.image.format != model.format) return;
  message.frame =
      observe(raw.camera, raw.label, raw.image.view(), segmenter_.segment(raw.image.view()));
  message.sent = Realtime::now();
  message.seq = live_seq_++;
  if (bus_.publish(frame_channel(camera()), encode(message))) ++published_;
}

/// More frames wait in the camera's queue than a hiccup explains.
bool CameraLane::is_behind() const {
  const CameraWorkerStatus status = worker_.status();
  return status.frames - status.dropped - received_ > kLiveBacklog;
}

LaneCounts CameraLane::counts() const {
  return {.received = received_,
          .written = written_,
          .write_errors = write_errors_,
          .published = published_,
          .not_live = not_live_};
}

bool CameraLane::quiet_since(MonotonicInstant since) const {
  const CameraWorkerStatus status = worker_.status();
  return last_frame_ns_ < to_ns(since) && status.frames - status.dropped == received_;
}

CameraLedger CameraLane::close(int64_t commanded) {
  end();
  log_.flush();
  CameraLedger ledger = account(camera(), written_pulses_, suspect_pulses_, commanded);
  ledger.received = worker_.status().frames;
  ledger.published = published_;
  return ledger;
}

}  // namespace v3d
