#include "daemon/camera_lane.h"

#include <algorithm>

#include "wire/channels.h"

namespace v3d {
namespace {

constexpr Duration kLook = std::chrono::milliseconds(50);

}  // namespace

CameraLane::CameraLane(CameraWorker& worker, Setup setup, Shared shared)
    : worker_(worker),
      shared_(shared),
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
    process(std::move(*frame));
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
  record(message);
  const int64_t pulse = message.frame.label.pulse;
  if (!shared_.gate.admits(pulse)) return;
  shared_.places.acquire(pulse);
  go_live(std::move(message));
  shared_.places.release();
}

void CameraLane::record(const FrameMessage& message) {
  if (!log_.write(message)) {
    ++write_errors_;
    return;
  }
  ++written_;
  const FrameLabel& label = message.frame.label;
  written_pulses_.push_back(label.pulse);
  if (label.suspect) suspect_pulses_.push_back(label.pulse);
}

void CameraLane::go_live(FrameMessage message) {
  const Frame raw = std::move(message.frame);
  if (raw.image.size != segmenter_.size() || raw.image.format != segmenter_.format()) return;
  message.frame =
      observe(raw.camera, raw.label, raw.image.view(), segmenter_.segment(raw.image.view()));
  message.sent = Realtime::now();
  message.seq = live_seq_++;
  if (shared_.bus.publish(frame_channel(camera()), encode(message))) ++published_;
}

LaneCounts CameraLane::counts() const {
  return {.received = received_,
          .written = written_,
          .write_errors = write_errors_,
          .published = published_};
}

bool CameraLane::quiet_since(MonotonicInstant since) const {
  const CameraWorkerStatus status = worker_.status();
  return last_frame_ns_ < to_ns(since) && status.frames - status.dropped == received_;
}

CameraLedger CameraLane::close(int64_t commanded) {
  end();
  CameraLedger ledger = account(camera(), written_pulses_, suspect_pulses_, commanded);
  ledger.received = worker_.status().frames;
  ledger.published = published_;
  return ledger;
}

}  // namespace v3d
