#include "daemon/captured/active_take.h"

#include <algorithm>
#include <map>
#include <utility>

#include "base/config/studio_values.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "capture/sync/pulse_times.h"
#include "daemon/captured/pulse_recorder.h"
#include "daemon/node/take_folder.h"

namespace v3d::captured {
namespace {

constexpr Duration kDrainTimeout = std::chrono::seconds(15);
constexpr Duration kMaxIdleTime = std::chrono::seconds(1);
/// The trigger's node reports the end of the train at once, and again a second later.
constexpr Duration kEndReportedWithin = std::chrono::milliseconds(1500);
/// Longest time from the end of a pulse until it is read from the sense line.
constexpr Duration kMaxReadDelay = std::chrono::milliseconds(100);
/// Time to collect the plates of the background, in addition to the duration of their train.
constexpr Duration kPlateTimeout = std::chrono::seconds(15);

constexpr int64_t kMinPlates = 2;
constexpr int64_t kMaxPlates = 256;  // all are in memory at the same time
/// Before a take has kMaxPulses, for the pulses until the train has ended.
constexpr double kLengthMarginSeconds = 10;

std::map<std::string, ChromaKey> chroma_keys(const Studio& studio) {
  std::map<std::string, ChromaKey> keys;
  for (const StudioCamera& camera : studio.cameras) keys[camera.name] = camera.chroma_key;
  return keys;
}

}  // namespace

void check_order(const wire::CommandMessage& order) {
  if (order.rate_hz != 0 && !is_pulse_rate(order.rate_hz)) {
    throw InputError(pulse_rate_error(order.rate_hz));
  }
  const bool learns = order.verb == wire::CommandVerb::kBackground;
  if (learns && order.pulses != 0 && (order.pulses < kMinPlates || order.pulses > kMaxPlates)) {
    throw InputError("a background of " + std::to_string(order.pulses) +
                     " pulses is not possible; expected 2 to 256");
  }
  if (order.pulses > take::kMaxPulses) {
    throw InputError("a take of " + format_count(order.pulses) +
                     " pulses is not possible; expected at most " + format_count(take::kMaxPulses));
  }
}

std::string length_stop_reason(const trigger::PulseTrain& train, int64_t commanded) {
  const auto margin = static_cast<int64_t>(kLengthMarginSeconds * train.rate_hz);
  if (train.count || commanded < take::kMaxPulses - margin) return "";
  return "it has about as many pulses as a take can have, " + format_count(take::kMaxPulses);
}

Duration idle_time_after_train(double rate_hz) {
  return std::clamp<Duration>(10 * period_of(rate_hz), capture::PulseTimes::kMaxSenseDelay,
                              kMaxIdleTime);
}

// --- begin and resume ---------------------------------------------------------------------------

std::unique_ptr<ActiveTake> ActiveTake::begin(Context context, Plan plan) {
  std::unique_ptr<ActiveTake> take(new ActiveTake(std::move(context), std::move(plan)));
  switch (take->plan_.order.verb) {
    case wire::CommandVerb::kArm:
      take->start_recording();
      break;
    case wire::CommandVerb::kCheck:
      take->start_check();
      break;
    default:
      take->learnt_cameras_ = take->context_.cameras.ready();
      take->start_pulse_recorder({});
  }
  return take;
}

std::unique_ptr<ActiveTake> ActiveTake::resume(Context context, Plan plan, TakeToResume resumed) {
  std::unique_ptr<ActiveTake> take(new ActiveTake(std::move(context), std::move(plan)));
  take->resume_recording(std::move(resumed));
  return take;
}

DiskDemand ActiveTake::disk_demand(const NodeCameras& cameras, const Plan& plan) {
  return {.rate_hz = plan.train.rate_hz,
          .bytes_per_pulse = cameras.bytes_per_pulse(),
          .pulses = plan.order.pulses > 0 ? std::optional(plan.order.pulses) : std::nullopt,
          .queue_frames = NodeCameras::kQueueFrames};
}

NodeTake::Plan ActiveTake::recording_plan() const {
  return {.order = plan_.order, .disk = disk_demand(context_.cameras, plan_)};
}

void ActiveTake::start_recording() {
  const NodeTake::Plan plan = recording_plan();
  check_disk(context_.studio.storage.takes, plan.disk);
  auto recording = NodeTake::begin(context_, plan);
  const take::TakePaths paths = recording->paths();
  try {
    start_pulse_recorder(paths.pulses());
  } catch (...) {
    recording.reset();
    node::quarantine_unarmed_take(paths);
    throw;
  }
  recording_ = std::move(recording);
}

void ActiveTake::resume_recording(TakeToResume resumed) {
  const take::TakePaths paths = node::take_paths(context_.studio, plan_.order.take);
  PulseRecorder::Resume resume{.sensed = {}, .commanded = resumed.commanded};
  for (const auto& [pulse, edge] : resumed.recorded.edges) resume.sensed.insert(pulse);
  auto recording = NodeTake::resume(context_, recording_plan(), std::move(resumed));
  start_pulse_recorder(paths.pulses(), std::move(resume));
  context_.trigger.start();
  was_started_ = true;
  recording_ = std::move(recording);
  recording_->rejoin(context_.trigger.reports_edges());
}

void ActiveTake::start_check() {
  const std::vector<capture::CameraWorker*> ready = context_.cameras.ready();
  start_pulse_recorder({});
  if (context_.sound != nullptr) {
    context_.sound->begin_check(plan_.train.rate_hz);
    listens_ = true;
  }
  check_ = std::make_unique<CameraCheck>(
      ready,
      CameraCheck::Setup{.rate_hz = plan_.train.rate_hz,
                         .background = context_.studio.storage.background},
      context_.bus);
}

std::optional<CheckedSound> ActiveTake::end_sound_check() {
  if (!std::exchange(listens_, false)) return std::nullopt;
  return context_.sound->end_check();
}

ActiveTake::~ActiveTake() { end_sound_check(); }

void ActiveTake::start_pulse_recorder(const std::filesystem::path& log,
                                      std::optional<PulseRecorder::Resume> resume) {
  pulses_ = std::make_unique<PulseRecorder>(context_.trigger.sensor(), context_.bus,
                                            PulseRecorder::Setup{.take = plan_.order.take,
                                                                 .train = plan_.train,
                                                                 .log = log,
                                                                 .on_edge = context_.on_edge,
                                                                 .resume = std::move(resume)});
}

void ActiveTake::start() {
  pulses_->start(Monotonic::now());
  was_started_ = true;
  if (plan_.order.verb != wire::CommandVerb::kBackground) return;
  const int64_t plates = plan_.train.count.value();
  learner_ = std::make_unique<BackgroundLearner>(
      learnt_cameras_,
      BackgroundPlan{.plates = plates,
                     .limit = (plates + 2) * period_of(plan_.train.rate_hz) + kPlateTimeout,
                     .folder = context_.studio.storage.background,
                     .rate_hz = plan_.train.rate_hz,
                     .keys = chroma_keys(context_.studio)},
      context_.bus);
}

// --- progress -----------------------------------------------------------------------------------

std::optional<BackgroundLearner::Result> ActiveTake::background_result() {
  return learner_->poll();
}

TakeCounts ActiveTake::counts() const {
  return {.frames = recording_ ? recording_->counts() : CameraPipelineCounts{},
          .pulses_not_live = recording_ ? recording_->pulses_not_live() : 0,
          .sensed = pulses_->sensed(),
          .commanded = commanded()};
}

bool ActiveTake::progressed_since(MonotonicInstant since) const {
  return (!recording_ || recording_->progressed_since(since)) && pulses_->progressed_since(since) &&
         (!learner_ || learner_->progressed_since(since)) &&
         (!check_ || check_->progressed_since(since));
}

// --- drain and close ----------------------------------------------------------------------------

void ActiveTake::train_ended() {
  context_.cameras.train_ended();
  if (learner_) learner_->train_ended();
  train_ended_at_ = Monotonic::now();
}

/// Whether all pulses of the train are known, or no more are expected. `is_idle`: nothing has
/// arrived recently.
bool ActiveTake::pulses_are_complete(bool is_idle) const {
  const NodeTrigger& trigger = context_.trigger;
  const Duration since = Monotonic::now() - train_ended_at_;
  // On other nodes the messages of the last pulses and of the end may still be in flight.
  if (!trigger.is_here()) return is_idle && (trigger.end_is_known() || since > kEndReportedWithin);
  if (pulses_->sensed() < commanded() && !is_idle) return false;
  // The sense line reports a pulse at its end, which may be after the generator was turned off.
  return !trigger.sensor_count_is_better() || since >= plan_.train.width + kMaxReadDelay;
}

bool ActiveTake::is_drained() const {
  const Duration since = Monotonic::now() - train_ended_at_;
  if (since >= kDrainTimeout) return true;
  const Duration idle_time = idle_time_after_train(plan_.train.rate_hz);
  const bool is_idle = since > idle_time;
  if (!pulses_are_complete(is_idle)) return false;
  if (check_) return is_idle || check_->has_received(commanded());
  return recording_->has_received(
      commanded(), is_idle ? std::optional(Monotonic::now() - idle_time) : std::nullopt);
}

bool ActiveTake::sensed_count_is_known(int64_t commanded) const {
  return v3d::captured::sensed_count_is_known(context_.studio.trigger.is_sensed(),
                                              context_.trigger.sensor() != nullptr,
                                              pulses_->sensed(), commanded);
}

TakeResult ActiveTake::close() {
  // First, because the log would have a pulse that comes later, and the ledger would not.
  pulses_->close();
  TakeResult result;
  take::Ledger& ledger = result.ledger;
  ledger.commanded = commanded();
  ledger.commanded_is_minimum =
      !context_.trigger.end_is_known() && plan_.train.count != ledger.commanded;
  if (check_) result.checked = check_->close(ledger.commanded);
  result.sound = end_sound_check();
  if (sensed_count_is_known(ledger.commanded)) pulses_->fill_ledger(ledger, ledger.commanded);
  if (recording_) recording_->stop_pipelines(ledger);
  result.counts = counts();
  check_.reset();
  const auto pulses = std::exchange(pulses_, nullptr);
  if (recording_) {
    const bool is_empty = is_empty_take(ledger, was_started_, context_.trigger.is_here());
    result.close_report =
        std::exchange(recording_, nullptr)->close(ledger, is_empty, pulses->synced());
  }
  if (pulses->lost_in_log() > 0) {
    result.close_report.pulse_log_error = "cannot write " + format_count(pulses->lost_in_log()) +
                                          " pulses to the pulse log of " + ledger.take + " in " +
                                          context_.studio.storage.takes.string();
  }
  return result;
}

}  // namespace v3d::captured
