#include "daemon/captured/camera_pipeline.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "base/error.h"
#include "wire/channels.h"

namespace v3d {
namespace {

constexpr Duration kLook = std::chrono::milliseconds(50);

}  // namespace

CameraPipeline::CameraPipeline(CameraWorker& worker, Setup setup, Shared shared)
    : worker_(worker),
      shared_(shared),
      take_(std::move(setup.take)),
      path_(setup.log),
      goes_on_(setup.past),
      segmenter_(std::move(setup.segmenter)),
      log_(setup.log, goes_on_ ? LogOpening::kGoOn : LogOpening::kNew, setup.hashing),
      preview_(shared.bus, worker.camera(), setup.rate_hz),
      live_numbers_(shared.bus.frame_groups()),
      last_frame_ns_(to_ns(Monotonic::now())) {
  if (setup.past) go_on_from(*setup.past);
  thread_ = std::thread([this] { run(); });
}

CameraPipeline::~CameraPipeline() { end(); }

void CameraPipeline::end() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void CameraPipeline::go_on_from(const ResumeState& past) {
  account_ = past.account;
  exposures_ = past.exposures;
  log_seq_ = received_ = written_ = past.camera.delivered;
}

/// A mask depends on the frames before it in the log: the segmenter learns from them what it had
/// learnt. Frames that come meanwhile are written as they come, and go without a live picture.
void CameraPipeline::learn_again() {
  size_t learnt = 0;
  try {
    for (size_t known = 1; learnt < known && !stopping_;) {
      FrameLogReader log(path_);
      known = log.labels().size();
      for (; learnt < known && !stopping_; ++learnt) learn_from(log, log.labels()[learnt].pulse);
    }
  } catch (const InputError& error) {  // of a disk that fails the lane hears when it writes
    spdlog::warn("{}", error.what());
  }
}

void CameraPipeline::learn_from(FrameLogReader& log, int64_t pulse) {
  heartbeat_.beat();
  while (auto frame = worker_.take(Monotonic::now())) write_only(std::move(*frame));
  if (!segmenter_.learns_from(pulse)) return;
  const auto raw = log.read(pulse);
  if (raw && raw->image.size == segmenter_.size() && raw->image.format == segmenter_.format()) {
    segment(*raw, true);
  }
}

void CameraPipeline::run() {
  if (goes_on_) learn_again();
  while (!stopping_) {
    heartbeat_.beat();
    auto frame = worker_.take(Monotonic::now() + kLook);
    if (!frame) continue;
    process(std::move(*frame));
    last_frame_ns_ = to_ns(Monotonic::now());
    ++received_;  // after the work: who counts received frames sees finished ones
  }
}

FrameMessage CameraPipeline::message_of(Frame frame) {
  return {.sent = Realtime::now(), .seq = log_seq_++, .take = take_, .frame = std::move(frame)};
}

void CameraPipeline::write_only(Frame frame) {
  record(message_of(std::move(frame)));
  last_frame_ns_ = to_ns(Monotonic::now());
  ++received_;
}

void CameraPipeline::process(Frame frame) {
  FrameMessage message = message_of(std::move(frame));
  const bool recorded = record(message);
  const Image& image = message.frame.image;
  if (image.size != segmenter_.size() || image.format != segmenter_.format()) return;
  const int64_t pulse = message.frame.label.pulse;
  // What the segmenter learns from must not depend on the gate: offline there is none.
  const bool learn = recorded && segmenter_.learns_from(pulse);
  const bool live = shared_.gate.admits(pulse);
  if (!learn && !live) return;
  const SemaphoreSlot place(shared_.places, pulse);
  Mask mask = segment(message.frame, learn);
  // Previews are made of what was segmented anyway: a node that is behind sends none.
  if (preview_.wants(pulse)) preview_.send(pulse, image.view(), &mask);
  if (live) go_live(std::move(message), std::move(mask));
}

bool CameraPipeline::record(const FrameMessage& message) {
  const FrameLabel& label = message.frame.label;
  exposures_.add(label.camera_counter);
  if (const io::Status written = log_.write(message); !written) {
    if (++write_errors_ == 1) spdlog::error("{}: {}", camera(), written.error().message);
    return false;
  }
  ++written_;
  account_.add(label.pulse, label.suspect);
  return true;
}

Mask CameraPipeline::segment(const Frame& raw, bool learn) {
  Mask mask = segmenter_.segment(raw.image.view());
  if (learn) segmenter_.learn(raw.label.pulse, raw.image.view(), mask);
  return mask;
}

void CameraPipeline::go_live(FrameMessage message, Mask mask) {
  const Frame raw = std::move(message.frame);
  message.frame = observe(raw.camera, raw.label, raw.image.view(), std::move(mask));
  message.sent = Realtime::now();
  const int64_t pulse = raw.label.pulse;
  message.seq = live_numbers_.next(pulse);
  if (shared_.bus.publish_frame(pulse, frame_channel(camera()), encode(message))) ++published_;
}

CameraPipelineCounts CameraPipeline::counts() const {
  return {.received = received_,
          .written = written_,
          .write_errors = write_errors_,
          .published = published_};
}

bool CameraPipeline::quiet_since(MonotonicInstant since) const {
  const CameraWorkerStatus status = worker_.status();
  return last_frame_ns_ < to_ns(since) && status.frames - status.dropped == received_;
}

CameraLedger CameraPipeline::close(int64_t commanded) {
  end();
  const io::Status kept = log_.sync();
  if (!kept) spdlog::error("{}: {}", camera(), kept.error().message);
  kept_ = kept.has_value();
  CameraLedger ledger = account_.ledger(camera(), commanded);
  ledger.exposed = exposures_.exposed();
  ledger.received = worker_.status().frames;
  ledger.published = published_;
  return ledger;
}

}  // namespace v3d
