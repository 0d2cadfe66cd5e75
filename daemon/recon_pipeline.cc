#include "daemon/recon_pipeline.h"

#include <algorithm>
#include <cmath>

#include "wire/channels.h"

namespace v3d {
namespace {

constexpr Duration kLook = std::chrono::milliseconds(20);
/// Frames of 15 cameras that wait for their set: half a second at 25 Hz.
constexpr size_t kFrameQueue = 256;
constexpr size_t kPulseQueue = 256;
/// Sets that wait for the reconstruction: half a second at 25 Hz rides out a hiccup of the machine;
/// more would only make live late.
constexpr size_t kReadyQueue = 12;
/// A pulse number so far ahead of all before is not believed.
constexpr int64_t kMaxJump = 15'000;
/// Pulses whose edge is remembered for the latency.
constexpr size_t kMaxEdges = 512;

double percentile(std::vector<double> values, double part) {
  if (values.empty()) return 0;
  const auto rank = static_cast<size_t>(std::ceil(part * static_cast<double>(values.size()))) - 1;
  const auto nth = values.begin() + static_cast<ptrdiff_t>(std::min(rank, values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

}  // namespace

ReconPipeline::ReconPipeline(Setup setup, Bus& bus)
    : take_(std::move(setup.take)),
      bus_(bus),
      reconstructor_(setup.rig, setup.options),
      assembler_(setup.sets),
      file_(setup.mesh_file),
      frames_(bus, std::string(kFramePrefix) + ".*", kFrameQueue),
      pulses_(bus, kPulseChannel, kPulseQueue),
      ready_(kReadyQueue),
      last_frame_ns_(to_ns(Monotonic::now())) {
  assembling_thread_ = std::thread([this] { assemble(); });
  reconstructing_thread_ = std::thread([this] { reconstruct(); });
}

ReconPipeline::~ReconPipeline() { close(); }

void ReconPipeline::end() {
  stopping_ = true;
  if (assembling_thread_.joinable()) assembling_thread_.join();
  if (reconstructing_thread_.joinable()) reconstructing_thread_.join();
}

bool ReconPipeline::close() {
  end();
  return file_.close();
}

// --- frames to sets -----------------------------------------------------------------------------

void ReconPipeline::assemble() {
  while (!stopping_) {
    assembling_.beat();
    note_pulses();
    const MonotonicInstant look = Monotonic::now() + kLook;
    auto message = frames_.wait(std::min(look, assembler_.next_deadline().value_or(look)));
    const MonotonicInstant now = Monotonic::now();
    if (!message) {
      hand_over(assembler_.poll(now));
      continue;
    }
    if (message->take != take_ || !message->frame.mask) {
      ++foreign_;
      continue;
    }
    last_frame_ns_ = to_ns(now);
    hand_over(assembler_.add(std::move(message->frame), now));
  }
}

void ReconPipeline::note_pulses() {
  while (const auto pulse = pulses_.wait(Monotonic::now())) {
    if (pulse->take != take_ || pulse->pulse - pulses_seen_ > kMaxJump) continue;
    pulses_seen_ = std::max<int64_t>(pulses_seen_, pulse->pulse + 1);
    const std::lock_guard lock(mutex_);
    edges_[pulse->pulse] = pulse->edge;
    if (edges_.size() > kMaxEdges) edges_.erase(edges_.begin());
  }
}

void ReconPipeline::hand_over(std::vector<ReadySet> ready) {
  for (ReadySet& set : ready) {
    if (!set.missing.empty()) ++incomplete_;
    ++handed_over_;
    ready_.push(std::move(set));
  }
  open_sets_ = assembler_.next_deadline() ? 1 : 0;
}

// --- sets to meshes -----------------------------------------------------------------------------

void ReconPipeline::reconstruct() {
  while (!stopping_) {
    reconstructing_.beat();
    if (const auto ready = ready_.pop(Monotonic::now() + kLook)) work_on(*ready);
  }
}

void ReconPipeline::work_on(const ReadySet& ready) {
  const Reconstruction result = reconstructor_.reconstruct(ready.set);
  publish(result, ready);
  if (!file_.append(result.pulse, result.compact)) ++write_errors_;
  ++meshes_;
}

void ReconPipeline::publish(const Reconstruction& result, const ReadySet& ready) {
  MeshMessage message{.sent = Realtime::now(),
                      .seq = seq_++,
                      .take = take_,
                      .pulse = result.pulse,
                      .pulse_edge = edge_of(result.pulse),
                      .missing = ready.missing,
                      .compact = result.compact};
  bus_.publish(kMeshChannel, encode(message));
  note_latency(message.pulse_edge);
}

RealtimeInstant ReconPipeline::edge_of(int64_t pulse) {
  const std::lock_guard lock(mutex_);
  const auto found = edges_.find(pulse);
  return found != edges_.end() ? found->second : RealtimeInstant();
}

void ReconPipeline::note_latency(RealtimeInstant edge) {
  const std::lock_guard lock(mutex_);
  last_mesh_ = Monotonic::now();
  if (first_mesh_ == MonotonicInstant()) first_mesh_ = last_mesh_;
  if (edge == RealtimeInstant()) return;
  const double latency_ms = 1e3 * to_seconds(Realtime::now() - edge);
  if (latencies_ms_.size() < kLatencies) {
    latencies_ms_.push_back(latency_ms);
  } else {
    latencies_ms_[next_latency_++ % kLatencies] = latency_ms;
  }
}

// --- what others see ----------------------------------------------------------------------------

ReconCounts ReconPipeline::counts() const {
  const SubscriptionCounts frames = frames_.counts();
  ReconCounts counts{.meshes = meshes_,
                     .dropped = ready_.dropped(),
                     .incomplete_sets = incomplete_,
                     .foreign = foreign_,
                     .frames_lost = frames.lost + frames.dropped,
                     .undecodable = frames.undecodable + pulses_.counts().undecodable,
                     .write_errors = write_errors_};
  const std::lock_guard lock(mutex_);
  counts.latency_p50_ms = percentile(latencies_ms_, 0.50);
  counts.latency_p99_ms = percentile(latencies_ms_, 0.99);
  const double seconds = to_seconds(last_mesh_ - first_mesh_);
  if (seconds > 0) counts.live_fps = static_cast<double>(counts.meshes - 1) / seconds;
  return counts;
}

bool ReconPipeline::drained(Duration quiet) const {
  return last_frame_ns_ < to_ns(Monotonic::now() - quiet) && open_sets_ == 0 &&
         meshes_ + ready_.dropped() == handed_over_;
}

}  // namespace v3d
