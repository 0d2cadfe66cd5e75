#include "daemon/captured/active_take.h"

#include <algorithm>
#include <map>
#include <utility>

#include "base/units.h"
#include "daemon/captured/known_pulses.h"
#include "daemon/node/take_folder.h"

namespace v3d {
namespace {

constexpr Duration kDrainWithin = std::chrono::seconds(15);
constexpr Duration kLongestQuiet = std::chrono::seconds(1);
/// A pulse is known of so long after its end.
constexpr Duration kSensedWithin = std::chrono::milliseconds(100);
/// The plates of the background, beyond their train.
constexpr Duration kPlatesWithin = std::chrono::seconds(15);

std::map<std::string, ChromaKey> chroma_keys(const Studio& studio) {
  std::map<std::string, ChromaKey> keys;
  for (const StudioCamera& camera : studio.cameras) keys[camera.name] = camera.chroma_key;
  return keys;
}

}  // namespace

// --- begins -------------------------------------------------------------------------------------

std::unique_ptr<ActiveTake> ActiveTake::begin(Node node, Plan plan) {
  std::unique_ptr<ActiveTake> take(new ActiveTake(std::move(node), std::move(plan)));
  switch (take->plan_.order.verb) {
    case CommandVerb::kArm:
      take->record();
      break;
    case CommandVerb::kCheck:
      take->look();
      break;
    default:
      take->listen_to_pulses({});
  }
  return take;
}

std::unique_ptr<ActiveTake> ActiveTake::go_on(Node node, Plan plan, int64_t commanded) {
  std::unique_ptr<ActiveTake> take(new ActiveTake(std::move(node), std::move(plan)));
  take->record_again(commanded);
  return take;
}

DiskDemand ActiveTake::disk_demand(const NodeCameras& cameras, const Plan& plan) {
  return {.rate_hz = plan.train.rate_hz,
          .bytes_per_pulse = cameras.bytes_per_pulse(),
          .pulses = plan.order.pulses > 0 ? std::optional(plan.order.pulses) : std::nullopt,
          .queue_frames = NodeCameras::kQueueFrames};
}

NodeTake::Plan ActiveTake::recording_plan() const {
  return {.order = plan_.order, .disk = disk_demand(node_.cameras, plan_)};
}

void ActiveTake::record() {
  const NodeTake::Plan plan = recording_plan();
  refuse_unfit_disk(node_.studio.storage.takes, plan.disk);
  auto recording = NodeTake::begin(node_, plan);
  listen_to_pulses(recording->paths().pulses());
  recording_ = std::move(recording);
}

void ActiveTake::record_again(int64_t commanded) {
  const TakePaths paths = take_paths(node_.studio, plan_.order.take);
  const EdgeTimes edges = edge_times(paths);
  PulseRecorder::Past past{.sensed = {}, .commanded = commanded};
  for (const auto& [pulse, edge] : edges) past.sensed.insert(pulse);
  auto recording = NodeTake::go_on(node_, recording_plan(), edges, node_.trigger.tells_edges());
  listen_to_pulses(paths.pulses(), std::move(past));
  node_.trigger.start();
  was_started_ = true;
  recording_ = std::move(recording);
}

void ActiveTake::look() {
  const std::vector<CameraWorker*> ready = node_.cameras.ready();
  listen_to_pulses({});
  check_ = std::make_unique<CameraCheck>(
      ready,
      CameraCheck::Setup{.rate_hz = plan_.train.rate_hz,
                         .background = node_.studio.storage.background},
      node_.bus);
}

void ActiveTake::listen_to_pulses(const std::filesystem::path& log,
                                  std::optional<PulseRecorder::Past> past) {
  pulses_ = std::make_unique<PulseRecorder>(node_.trigger.sensor(), node_.bus,
                                            PulseRecorder::Setup{.take = plan_.order.take,
                                                                 .train = plan_.train,
                                                                 .log = log,
                                                                 .on_edge = node_.on_edge,
                                                                 .past = std::move(past)});
}

void ActiveTake::start() {
  was_started_ = true;
  if (plan_.order.verb != CommandVerb::kBackground) return;
  const int64_t plates = plan_.train.count.value();
  learner_ = std::make_unique<BackgroundLearner>(
      node_.cameras.ready(),
      LearnPlan{.plates = plates,
                .limit = (plates + 2) * period_of(plan_.train.rate_hz) + kPlatesWithin,
                .folder = node_.studio.storage.background,
                .rate_hz = plan_.train.rate_hz,
                .keys = chroma_keys(node_.studio)},
      node_.bus);
}

// --- goes on ------------------------------------------------------------------------------------

std::optional<BackgroundLearner::Result> ActiveTake::learnt() { return learner_->poll(); }

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

// --- ends ---------------------------------------------------------------------------------------

void ActiveTake::train_ended() {
  node_.cameras.train_ended();
  if (learner_) learner_->train_ended();
  ended_ = Monotonic::now();
}

/// Those of the train, as far as they will ever be.
bool ActiveTake::pulses_are_known(bool silent) const {
  const NodeTrigger& trigger = node_.trigger;
  // Elsewhere the last ones may not have been heard of yet.
  if (!trigger.is_here()) return silent;
  if (pulses_->sensed() < commanded() && !silent) return false;
  // A pulse that was under way when they were turned off is known of at its end.
  return !trigger.only_sensor_counts() ||
         Monotonic::now() - ended_ >= plan_.train.width + kSensedWithin;
}

bool ActiveTake::is_accounted_for() const {
  const Duration since = Monotonic::now() - ended_;
  if (since >= kDrainWithin) return true;
  const Duration quiet = std::min<Duration>(kLongestQuiet, 10 * period_of(plan_.train.rate_hz));
  const bool silent = since > quiet;
  if (!pulses_are_known(silent)) return false;
  if (check_) return silent || check_->has(commanded());
  return recording_->has_all(commanded(),
                             silent ? std::optional(Monotonic::now() - quiet) : std::nullopt);
}

bool ActiveTake::knows_what_was_sensed(int64_t commanded) const {
  return v3d::knows_what_was_sensed(node_.studio.trigger.is_sensed(),
                                    node_.trigger.sensor() != nullptr, pulses_->sensed(),
                                    commanded);
}

TakeAccount ActiveTake::close() {
  TakeAccount account;
  Ledger& ledger = account.ledger;
  ledger.commanded = commanded();
  if (check_) account.checked = check_->close(ledger.commanded);
  if (knows_what_was_sensed(ledger.commanded)) pulses_->put_into(ledger, ledger.commanded);
  if (recording_) recording_->end(ledger);
  account.counts = counts();
  check_.reset();
  pulses_->close();
  const auto pulses = std::exchange(pulses_, nullptr);
  if (recording_) {
    const bool is_empty = is_empty_take(ledger, was_started_, node_.trigger.is_here());
    account.closing = std::exchange(recording_, nullptr)->close(ledger, is_empty);
  }
  const std::string takes = node_.studio.storage.takes.string();
  if (!pulses->is_kept() && account.closing.unkept.empty()) {
    account.closing.unkept = takes + " did not keep the last pulses in the log of " + ledger.take +
                             ": v3dctl verify tells which";
  }
  if (pulses->lost_in_log() > 0) {
    account.closing.lost_pulses = takes + " refused " + format_count(pulses->lost_in_log()) +
                                  " of the pulses in the log of " + ledger.take;
  }
  return account;
}

}  // namespace v3d
