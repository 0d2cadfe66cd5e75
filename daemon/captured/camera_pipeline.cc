#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "base/core/error.h"
#include "daemon/captured/node_take.h"
#include "wire/messages.h"

namespace v3d::captured {
namespace {

constexpr Duration kPollInterval = std::chrono::milliseconds(50);

/// Ends the reading of a log.
struct Stopped {};

/// Number of events of the log that is continued; empty where it is not known.
std::optional<int64_t> earlier_events(const std::optional<ResumeState>& resume) {
  return resume && resume->log ? std::optional(resume->log->events()) : std::nullopt;
}

}  // namespace

CameraPipeline::CameraPipeline(capture::CameraWorker& worker, Setup setup, Shared shared)
    : worker_(worker),
      shared_(shared),
      take_(std::move(setup.take)),
      is_resumed_(setup.resume),
      segmenter_(std::move(setup.segmenter)),
      log_(setup.log, is_resumed_ ? take::LogOpening::kContinue : take::LogOpening::kNew,
           setup.hashing, take::EventLogWriter::kSyncPeriod, earlier_events(setup.resume)),
      preview_(shared.bus, worker.camera(), setup.rate_hz),
      live_numbers_(shared.bus.frame_groups()),
      last_frame_ns_(to_ns(Monotonic::now())) {
  if (setup.resume) {
    restore_counts(*setup.resume);
    earlier_log_ = std::move(setup.resume->log);
  }
  thread_ = std::thread([this] { run(); });
}

CameraPipeline::~CameraPipeline() { stop_thread(); }

void CameraPipeline::stop_thread() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void CameraPipeline::restore_counts(const ResumeState& state) {
  account_ = state.account;
  exposures_ = state.exposures;
  log_seq_ = received_ = written_ = state.camera.delivered;
}

/// Masks depend on all earlier frames, because the segmenter adapts to the background. After a
/// restart it learns again from the frames in the log. New frames are meanwhile written, but not
/// published. Then it learns from these, which may take long enough for further ones.
void CameraPipeline::replay_logs() {
  try {
    if (earlier_log_) replay(*earlier_log_);
    earlier_log_.reset();
    for (int64_t from = 0; from < log_.bytes() && !stopping_;) {
      const auto begin = static_cast<uint64_t>(std::exchange(from, log_.bytes()));
      const auto progress = [this] {
        if (stopping_) throw Stopped();
        write_waiting_frames();
      };
      take::FrameLogReader added(log_.path(), progress, begin);
      replay(added);
    }
  } catch (const Stopped&) {
  } catch (const InputError& error) {  // a disk that fails is reported by the next write
    spdlog::warn("{}", error.what());
  }
}

void CameraPipeline::replay(take::FrameLogReader& log) {
  for (const FrameLabel& label : log.labels()) {
    if (stopping_) return;
    write_waiting_frames();
    if (segmenter_.learns_from(label.pulse)) learn_again(log, label.pulse);
  }
}

void CameraPipeline::learn_again(take::FrameLogReader& log, int64_t pulse) {
  const auto raw = log.read(pulse);
  if (raw && raw->image.size == segmenter_.size() && raw->image.format == segmenter_.format()) {
    segment(*raw, true);
  }
}

/// Call often while a log is read: the queue of the camera is short.
void CameraPipeline::write_waiting_frames() {
  heartbeat_.beat();
  while (auto frame = worker_.pop(Monotonic::now())) write_only(std::move(*frame));
}

void CameraPipeline::run() {
  if (is_resumed_) replay_logs();
  while (!stopping_) {
    heartbeat_.beat();
    auto frame = worker_.pop(Monotonic::now() + kPollInterval);
    if (!frame) continue;
    process(std::move(*frame));
    count_finished_frame();
  }
}

/// After the work, so that counts() reports only finished frames.
void CameraPipeline::count_finished_frame() {
  last_frame_ns_ = to_ns(Monotonic::now());
  pulses_ = certain_pulses_.size();
  ++received_;
}

wire::FrameMessage CameraPipeline::make_message(Frame frame) {
  return {.sent = Realtime::now(), .seq = log_seq_++, .take = take_, .frame = std::move(frame)};
}

void CameraPipeline::write_only(Frame frame) {
  record(make_message(std::move(frame)));
  count_finished_frame();
}

void CameraPipeline::process(Frame frame) {
  wire::FrameMessage message = make_message(std::move(frame));
  const bool recorded = record(message);
  Image& image = message.frame.image;
  reduce_to_8_bits(image);
  if (image.size != segmenter_.size() || image.format != segmenter_.format()) return;
  const int64_t pulse = message.frame.label.pulse;
  // Learning must not depend on the admission: the offline reconstruction has none.
  const bool learn = recorded && segmenter_.learns_from(pulse);
  const bool live = shared_.admission.admits(pulse);
  if (!learn && !live) return;
  const SemaphoreSlot slot(shared_.slots, pulse);
  Mask mask = segment(message.frame, learn);
  // Only frames that are segmented anyway get a preview: an overloaded node sends none.
  if (preview_.is_due(pulse)) preview_.send(pulse, image.view(), &mask);
  if (live) publish_live(std::move(message), std::move(mask));
}

bool CameraPipeline::record(const wire::FrameMessage& message) {
  const FrameLabel& label = message.frame.label;
  exposures_.add(label.camera_counter);
  if (const io::Status written = log_.write(message); !written) {
    if (++write_errors_ == 1) spdlog::error("{}: {}", camera(), written.error().message);
    return false;
  }
  ++written_;
  account_.add(label.pulse, label.suspect);
  if (!label.suspect) certain_pulses_.insert(label.pulse);
  return true;
}

Mask CameraPipeline::segment(const Frame& raw, bool learn) {
  Mask mask = segmenter_.segment(raw.image.view());
  if (learn) segmenter_.learn(raw.label.pulse, raw.image.view(), mask);
  return mask;
}

void CameraPipeline::publish_live(wire::FrameMessage message, Mask mask) {
  const Frame raw = std::move(message.frame);
  message.frame = observe(raw.camera, raw.label, raw.image.view(), std::move(mask));
  message.sent = Realtime::now();
  const int64_t pulse = raw.label.pulse;
  message.seq = live_numbers_.next(pulse);
  if (shared_.bus.publish_frame(pulse, wire::frame_channel(camera()), encode(message)))
    ++published_;
}

CameraPipelineCounts CameraPipeline::counts() const {
  return {.received = received_,
          .pulses = pulses_,
          .written = written_,
          .write_errors = write_errors_,
          .published = published_};
}

bool CameraPipeline::idle_since(MonotonicInstant since) const {
  const capture::CameraWorkerStatus status = worker_.status();
  return last_frame_ns_ < to_ns(since) && status.frames - status.dropped == received_;
}

take::CameraLedger CameraPipeline::close(int64_t commanded) {
  stop_thread();
  synced_ = log_.end();
  if (!synced_) spdlog::error("{}: {}", camera(), synced_.error().message);
  take::CameraLedger ledger = account_.ledger(camera(), commanded);
  ledger.exposed = exposures_.exposed();
  ledger.received = worker_.status().frames;
  ledger.published = published_;
  return ledger;
}

void CameraPipeline::save_index() const {
  if (const io::Status saved = log_.save_index(); !saved) {
    spdlog::error("{}: {}; v3dctl verify --recover writes it", camera(), saved.error().message);
  }
}

}  // namespace v3d::captured
