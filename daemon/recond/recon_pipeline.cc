#include "daemon/recond/recon_pipeline.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "wire/messages.h"

namespace v3d::recond {
namespace {

constexpr Duration kPollPeriod = std::chrono::milliseconds(20);
/// Frames: 0.7 s of 15 cameras at 25 Hz.
constexpr size_t kFrameQueue = 256;
constexpr size_t kPulseQueue = 256;
/// Pulses whose edge time is kept for the latency.
constexpr size_t kMaxEdges = 512;
constexpr int kMinOpenSets = 16, kMaxOpenSets = 64;

}  // namespace

int open_sets_of(Duration deadline, double rate_hz) {
  const double pulses = std::ceil(to_seconds(deadline) * rate_hz) + 1;
  return static_cast<int>(std::clamp<double>(pulses, kMinOpenSets, kMaxOpenSets));
}

MeshStages stages_of(const std::shared_ptr<recon::Reconstructor>& reconstructor) {
  return {
      .make_mesh = [reconstructor](recon::FrameSetJob& work) { reconstructor->make_mesh(work); },
      .encode = [reconstructor](recon::FrameSetJob& work) { reconstructor->encode(work); },
      .begin_sequence = [reconstructor] { reconstructor->begin_sequence(); }};
}

namespace {

recon::FrameSetOptions starting_after(recon::FrameSetOptions sets,
                                      std::optional<int64_t> last_pulse) {
  sets.released_until = last_pulse;
  return sets;
}

}  // namespace

ReconPipeline::ReconPipeline(Setup setup, bus::Bus& bus)
    : take_(std::move(setup.take)),
      cameras_(setup.sets.cameras),
      bus_(bus),
      stages_(std::move(setup.stages)),
      on_set_begins_(std::move(setup.on_set_begins)),
      on_set_ends_(std::move(setup.on_set_ends)),
      on_finished_set_(std::move(setup.on_finished_set)),
      file_(setup.mesh_file,
            setup.resume_at ? take::LogOpening::kContinue : take::LogOpening::kNew),
      meshes_before_(static_cast<int64_t>(file_.size())),
      assembler_(starting_after(setup.sets, file_.last_pulse())),
      frames_(bus, std::string(wire::kFramePrefix) + ".*", kFrameQueue),
      pulses_(bus, wire::kPulseChannel, kPulseQueue),
      ready_({.on_drop =
                  [this](const recon::ReadySet& ready) {
                    if (shared_) shared_->give_up(ready.set.pulse);
                  }}),
      warm_up_(std::move(setup.warm_up)),
      sequences_(!setup.resume_at),
      max_passes_(setup.live_passes),
      passes_(setup.live_passes),
      by_passes_(static_cast<size_t>(setup.live_passes) + 1),
      repair_(make_repair(std::move(setup.repair))),
      labeller_(setup.performers ? std::make_unique<recon::PerformerLabeller>() : nullptr),
      shared_(make_shared_take(setup.shard)),
      pipeline_(setup.threads, [this] { return next_job(); },
                {[this](Job& job) {
                   on_set_begins_();
                   make_mesh(job);
                 },
                 [this](Job& job) {
                   finish(job);
                   on_set_ends_();
                 }}) {
  plausible_.add(setup.resume_at.value_or(0), Monotonic::now());
  assembling_thread_ = std::thread([this] { assemble(); });
}

std::unique_ptr<SharedTake> ReconPipeline::make_shared_take(
    const std::optional<Shard::Setup>& setup) {
  if (!setup) return nullptr;
  const auto work = [this](recon::ReadySet set) { ready_.push(std::move(set), Monotonic::now()); };
  const auto ordered = [this](const wire::MeshMessage& mesh) { store(mesh); };
  const auto receive = [this](const bus::FrameGroupSet& groups) { return receive_groups(groups); };
  return std::make_unique<SharedTake>(*setup, bus_, SharedTake::Receivers{work, ordered, receive});
}

std::unique_ptr<LiveRepair> ReconPipeline::make_repair(std::optional<LiveRepair::Setup> setup) {
  if (!setup) return nullptr;
  return std::make_unique<LiveRepair>(*std::move(setup), [this] {
    reconstructing_.beat();
    return ready_.behind(Monotonic::now()) ? RepairLoadControl::kMaxWaiting : ready_.size();
  });
}

ReconPipeline::~ReconPipeline() {
  if (const io::Status closed = close(); !closed) spdlog::error("{}", closed.error().message);
}

void ReconPipeline::stop() {
  stopping_ = true;
  if (assembling_thread_.joinable()) assembling_thread_.join();
  pipeline_.wait();
  ready_.drop_all(Monotonic::now());
  if (shared_) shared_->stop();
}

io::Status ReconPipeline::close() {
  stop();
  return file_.close();
}

// --- frames to sets -----------------------------------------------------------------------------

void ReconPipeline::assemble() {
  while (!stopping_) {
    assembling_.beat();
    record_pulses();
    const MonotonicInstant latest = Monotonic::now() + kPollPeriod;
    const MonotonicInstant until = std::min(latest, assembler_.next_deadline().value_or(latest));
    auto message = frames_.wait(until);
    const MonotonicInstant now = Monotonic::now();
    if (!message) {
      dispatch(assembler_.poll(now));
      idle_.on_empty(until);  // not `now`: after a pause, a frame may have arrived since
      continue;
    }
    if (message->take != take_ || !message->frame.mask) {
      ++foreign_;
      continue;
    }
    idle_.on_received(now);
    record_arrival(*message);
    reduce_to_8_bits(message->frame.image);
    dispatch(assembler_.add(std::move(message->frame), now));
    late_ = assembler_.counters().late;
    implausible_frames_ = assembler_.counters().implausible;
  }
}

bool ReconPipeline::receive_groups(const bus::FrameGroupSet& groups) {
  {
    const std::lock_guard lock(mutex_);
    for (const size_t group : groups) {
      if (!groups_ || groups_->contains(group)) continue;
      for (const std::string& camera : cameras_)
        sequences_.start_new_count(series_of(camera, group));
    }
  }
  std::string failure;
  try {
    bus_.join_frame_groups(groups);
  } catch (const std::runtime_error& error) {  // the network may come back
    failure = error.what();
  }
  const std::lock_guard lock(mutex_);
  if (failure.empty()) groups_ = groups;
  join_failure_ = std::move(failure);
  return join_failure_.empty();
}

std::string ReconPipeline::series_of(const std::string& camera, size_t group) const {
  return camera + " " + std::to_string(group);
}

void ReconPipeline::record_arrival(const wire::FrameMessage& message) {
  const std::string& camera = message.frame.camera;
  if (std::find(cameras_.begin(), cameras_.end(), camera) == cameras_.end()) return;
  const auto groups = static_cast<int64_t>(bus_.frame_groups());
  const auto group = static_cast<size_t>(message.seq % groups);
  const std::lock_guard lock(mutex_);
  sequences_.note(series_of(camera, group), message.seq / groups, message.sent);
}

void ReconPipeline::record_pulses() {
  while (const auto pulse = pulses_.wait(Monotonic::now())) {
    if (pulse->take != take_) continue;
    const MonotonicInstant now = Monotonic::now();
    if (!plausible_.contains(pulse->pulse, now)) {
      ++implausible_pulses_;
      continue;
    }
    plausible_.add(pulse->pulse, now);
    if (shared_) shared_->on_pulse(pulse->pulse);
    const std::lock_guard lock(mutex_);
    edges_[pulse->pulse] = pulse->edge;
    if (edges_.size() > kMaxEdges) edges_.erase(edges_.begin());
  }
}

void ReconPipeline::dispatch(std::vector<recon::ReadySet> ready) {
  for (recon::ReadySet& set : ready) {
    if (!set.missing.empty()) ++incomplete_;
    ++dispatched_;
    if (shared_) {
      shared_->add(std::move(set));
    } else {
      ready_.push(std::move(set), Monotonic::now());
    }
  }
  open_sets_ = assembler_.next_deadline() ? 1 : 0;
}

// --- sets to meshes -----------------------------------------------------------------------------

std::optional<ReconPipeline::Job> ReconPipeline::next_job() {
  if (warm_up_) {
    Job job{recon::FrameSetJob(*std::move(warm_up_)), {}, {}, true};
    warm_up_.reset();
    return job;
  }
  while (!stopping_) {
    reconstructing_.beat();
    ready_.wait(Monotonic::now() + kPollPeriod);
    if (auto ready = ready_.pop(Monotonic::now())) {
      if (shared_ && !shared_->begin(ready->set.pulse)) continue;
      return Job{recon::FrameSetJob(std::move(ready->set)), std::move(ready->missing), {}, false};
    }
  }
  return std::nullopt;
}

void ReconPipeline::run_stage(const std::function<void(recon::FrameSetJob&)>& stage, Job& job) {
  if (!job.failure.empty()) return;
  try {
    stage(job.work);
  } catch (
      const std::exception& error) {  // the surface is too large for the format, or for the memory
    job.failure = error.what();
  }
  reconstructing_.beat();
}

void ReconPipeline::repair(Job& job) {
  if (!repair_) return;
  if (job.is_warm_up) return repair_->warm_up(job.work.set);
  LiveRepair::Result result = repair_->run(job.work.set);
  job.replaced = std::move(result.replaced);
  if (result.started) passes_.ignore_waiting();
}

/// The warm-up gets all passes, to allocate memory for them.
void ReconPipeline::limit_passes(Job& job) {
  job.work.live_passes = max_passes_;
  if (job.is_warm_up) return;
  job.work.live_passes = passes_.begin_pulse(ready_.size(), ready_.behind(Monotonic::now()));
  job.work.may_run_pass = [this] { return passes_.may_run(ready_.size()); };
}

void ReconPipeline::make_mesh(Job& job) {
  run_stage(
      [&](recon::FrameSetJob& work) {
        repair(job);
        limit_passes(job);
        stages_.make_mesh(work);
      },
      job);
}

/// The last stage gets the sets by ascending pulse, and the labels of a mesh follow from the meshes
/// before. A pulse that cannot be encoded has no mesh, so the next pulse must not follow from it.
void ReconPipeline::encode_mesh(Job& job) {
  if (!labeller_ || job.is_warm_up) return run_stage(stages_.encode, job);
  run_stage(
      [&](recon::FrameSetJob& work) {
        work.result.performers = labeller_->label(work.set.pulse, work.volume);
        try {
          stages_.encode(work);
        } catch (...) {
          labeller_->undo();
          throw;
        }
        performers_ = static_cast<int64_t>(labeller_->count());
      },
      job);
}

void ReconPipeline::finish(Job& job) {
  job.work.set.exposure = edge_of(job.work.set.pulse);
  if (shared_) stages_.begin_sequence();
  encode_mesh(job);
  if (job.is_warm_up) return stages_.begin_sequence();
  if (!job.failure.empty()) return record_failure(job);
  ghosts_ += job.work.result.ghosts;
  ++by_passes_[static_cast<size_t>(job.work.result.live_passes)];
  wire::MeshMessage mesh = message_of(job);
  if (shared_) {
    shared_->add_mesh(std::move(mesh));
  } else {
    mesh.seq = seq_++;
    bus_.publish_authenticated(wire::kMeshChannel, encode(mesh));
    if (!store(mesh)) stages_.begin_sequence();
  }
  if (!job.replaced.empty()) {
    repair_->record(job.work.set.pulse);
    restore_masks(std::move(job.replaced), job.work.set);
  }
  if (on_finished_set_) on_finished_set_(job.work.set);
}

/// Called by the last stage or, in a shared take, by SharedTake, perhaps while the constructor
/// still sets shared_. Returns false after a write error.
bool ReconPipeline::store(const wire::MeshMessage& mesh) {
  record_mesh(mesh);
  const io::Status written = file_.append(mesh.pulse, mesh.compact);
  if (!written && ++write_errors_ == 1) spdlog::error("{}", written.error().message);
  ++meshes_;
  return written.has_value();
}

void ReconPipeline::record_failure(const Job& job) {
  spdlog::warn("pulse {} has no mesh: {}", job.work.set.pulse, job.failure);
  {
    const std::lock_guard lock(mutex_);
    failure_ = job.failure;
  }
  ++failed_;
  if (shared_) shared_->give_up(job.work.set.pulse);
}

wire::MeshMessage ReconPipeline::message_of(const Job& job) {
  const recon::Reconstruction& result = job.work.result;
  return {.sent = Realtime::now(),
          .seq = 0,
          .take = take_,
          .pulse = result.pulse,
          .pulse_edge = edge_of(result.pulse),
          .silhouette_iou = result.quality.silhouette_iou,
          .coverage = result.quality.coverage,
          .cameras = result.quality.cameras,
          .missing = job.missing,
          .compact = result.compact};
}

void ReconPipeline::record_mesh(const wire::MeshMessage& mesh) {
  record_latency(mesh.pulse_edge);
  const std::lock_guard lock(mutex_);
  quality_ = {
      .silhouette_iou = mesh.silhouette_iou, .coverage = mesh.coverage, .cameras = mesh.cameras};
}

RealtimeInstant ReconPipeline::edge_of(int64_t pulse) {
  const std::lock_guard lock(mutex_);
  const auto found = edges_.find(pulse);
  return found != edges_.end() ? found->second : RealtimeInstant();
}

void ReconPipeline::record_latency(RealtimeInstant edge) {
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

// --- counts -------------------------------------------------------------------------------------

ReconCounts ReconPipeline::counts() const {
  const bus::SubscriptionCounts frames = frames_.counts();
  ReconCounts counts{.meshes = meshes_before_ + meshes_,
                     .dropped = ready_.dropped(),
                     .waiting = static_cast<int64_t>(ready_.size()),
                     .behind = ready_.behind(Monotonic::now()),
                     .failed = failed_,
                     .failure = {},
                     .incomplete_sets = incomplete_,
                     .foreign = foreign_,
                     .frames_late = late_,
                     .frames_lost = 0,
                     .frames_dropped = frames.dropped,
                     .cameras = {},
                     .ghosts = ghosts_,
                     .undecodable = frames.undecodable + pulses_.counts().undecodable,
                     .implausible = implausible_frames_ + implausible_pulses_,
                     .write_errors = write_errors_};
  if (repair_) counts.repair = repair_->counts();
  if (labeller_) counts.performers = performers_;
  if (max_passes_ > 0) counts.by_passes.assign(by_passes_.begin(), by_passes_.end());
  if (shared_) {
    counts.shard = shared_->counts();
    counts.without_mesh = shared_->without_mesh();
    counts.undecodable += shared_->undecodable();
    counts.implausible += counts.shard->implausible;
  }
  const std::lock_guard lock(mutex_);
  counts.failure = failure_;
  counts.join_failure = join_failure_;
  counts.quality = quality_;
  counts.frames_lost = sequences_.total().lost;
  for (const std::string& camera : cameras_) {
    for (size_t group = 0; group < bus_.frame_groups(); ++group) {
      counts.cameras[camera] += sequences_.of(series_of(camera, group));
    }
  }
  counts.latency_p50_ms = percentile(latencies_ms_, 0.50);
  counts.latency_p99_ms = percentile(latencies_ms_, 0.99);
  const double seconds = to_seconds(last_mesh_ - first_mesh_);
  if (seconds > 0) counts.live_fps = static_cast<double>(meshes_ - 1) / seconds;
  return counts;
}

void ReconPipeline::on_last_pulse(int64_t pulse) {
  if (shared_) shared_->on_pulse(pulse);
}

bool ReconPipeline::drained(Duration idle_time) const {
  const bool is_idle = idle_.idle_for(idle_time) && open_sets_ == 0;
  if (shared_) return is_idle && shared_->is_settled();
  return is_idle && meshes_ + failed_ + ready_.dropped() == dispatched_;
}

}  // namespace v3d::recond
