#include "daemon/capture_node.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <thread>

#include "base/error.h"
#include "base/units.h"
#include "daemon/advice.h"
#include "daemon/json.h"
#include "daemon/service.h"
#include "daemon/take_folder.h"
#include "trigger/make_trigger.h"

namespace v3d {
namespace {

constexpr Duration kReadyWithin = std::chrono::seconds(15);
constexpr Duration kDrainWithin = std::chrono::seconds(15);
constexpr Duration kLongestQuiet = std::chrono::seconds(1);
/// A pulse is known of so long after its end.
constexpr Duration kSensedWithin = std::chrono::milliseconds(100);
constexpr int64_t kDefaultPlates = 16;
constexpr int64_t kDefaultCheckPulses = 100;
/// A check waits no longer for a camera: it is to tell which ones are not there.
constexpr Duration kCheckReadyWithin = std::chrono::seconds(5);
constexpr int64_t kMinPlates = 2;
constexpr int64_t kMaxPlates = 256;  // they are all in memory at once
/// A frame later than so many periods counts as missing in health.
constexpr int64_t kLatePeriods = 5;

/// Commands come from the network.
void refuse_absurd(const CommandMessage& order) {
  if (order.rate_hz != 0 && !(order.rate_hz >= kMinRateHz && order.rate_hz <= kMaxRateHz)) {
    throw InputError("a rate of " + std::to_string(order.rate_hz) +
                     " Hz is not possible; expected 0.01 to 1000");
  }
  const bool learns = order.verb == CommandVerb::kBackground;
  if (learns && order.pulses != 0 && (order.pulses < kMinPlates || order.pulses > kMaxPlates)) {
    throw InputError("a background of " + std::to_string(order.pulses) +
                     " pulses is not possible; expected 2 to 256");
  }
}

std::vector<std::string> other_capture_nodes(const Studio& studio, const std::string& node) {
  std::vector<std::string> others;
  for (const StudioNode& other : studio.nodes) {
    if (other.name != node && !studio.cameras_of(other.name).empty()) others.push_back(other.name);
  }
  return others;
}

}  // namespace

CaptureNode::CaptureNode(const Studio& studio, const std::string& node, Bus& bus)
    : studio_(studio),
      node_(node),
      bus_(bus),
      events_(bus, node),
      camera_watch_(events_),
      pulse_times_(period_of(studio.trigger.rate_hz)),
      kept_orders_(studio, node),
      cameras_(studio, node, pulse_times_),
      places_(static_cast<int>(std::max(1U, std::thread::hardware_concurrency()))) {
  const bool triggers = studio.trigger.node == node;
  if (cameras_.size() == 0 && !triggers) {
    throw InputError(studio.path.string() + ": node '" + node +
                     "' has neither a camera nor the trigger; v3d-captured has nothing to do here");
  }
  if (triggers) {
    generator_ = make_generator(studio.trigger);
    sensor_ = make_sensor(studio.trigger);
    full_disks_ = std::make_unique<FullDiskWatch>(bus, other_capture_nodes(studio, node));
  } else {
    train_ = std::make_unique<TrainWatch>(bus, studio.trigger.node);
  }
}

CaptureNode::~CaptureNode() { disarm(); }

// --- commands -----------------------------------------------------------------------------------

void CaptureNode::arm(const CommandMessage& order) {
  if (order.verb == CommandVerb::kCheck) {
    make_ready(order, order.pulses > 0 ? order.pulses : kDefaultCheckPulses);
    return;
  }
  refuse_bad_take(studio_, order.take);
  cameras_.refuse_unprepared(order.allow_missing);
  make_ready(order, order.pulses > 0 ? std::optional(order.pulses) : std::nullopt);
}

void CaptureNode::learn(const CommandMessage& order) {
  make_ready(order, order.pulses > 0 ? order.pulses : kDefaultPlates);
}

void CaptureNode::begin_order(const CommandMessage& order, std::optional<int64_t> pulses) {
  order_ = order;
  rate_hz_ = order.rate_hz > 0 ? order.rate_hz : studio_.trigger.rate_hz;
  pulse_train_ = {.rate_hz = rate_hz_,
                  .width = from_seconds(studio_.trigger.pulse_width_us * 1e-6),
                  .count = pulses};
  pulse_times_.begin(period_of(rate_hz_));
  camera_watch_.begin_train();
  disk_is_full_ = false;
  cameras_armed_ = false;
}

void CaptureNode::make_ready(const CommandMessage& order, std::optional<int64_t> pulses) {
  refuse_absurd(order);
  kept_orders_.forget();
  begin_order(order, pulses);
  if (generator_) {
    generator_->stop();
    generator_->arm(pulse_train_);
  } else {
    arm_cameras();
  }
}

/// Not before the generator is armed: what it does until then is no pulse of the train.
void CaptureNode::arm_cameras() {
  cameras_.arm(period_of(rate_hz_), edges_are_told());
  cameras_armed_ = true;
  const Duration within = checks() ? kCheckReadyWithin : kReadyWithin;
  ready_by_ = Monotonic::now() + within + 2 * period_of(rate_hz_);
}

bool CaptureNode::is_arming_trigger() {
  if (cameras_armed_) return false;
  if (!generator_->armed()) return true;
  arm_cameras();
  return false;
}

std::map<std::string, ChromaKey> CaptureNode::chroma_keys() const {
  std::map<std::string, ChromaKey> keys;
  for (const StudioCamera& camera : studio_.cameras) keys[camera.name] = camera.chroma_key;
  return keys;
}

void CaptureNode::start() {
  first_pulse_told_ = false;
  if (order_.verb == CommandVerb::kBackground) {
    const int64_t plates = order_.pulses > 0 ? order_.pulses : kDefaultPlates;
    learner_ = std::make_unique<BackgroundLearner>(
        cameras_.ready(),
        LearnPlan{.plates = plates,
                  .limit = (plates + 2) * period_of(rate_hz_) + kReadyWithin,
                  .folder = studio_.storage.background,
                  .rate_hz = rate_hz_,
                  .keys = chroma_keys()},
        bus_);
  }
  if (train_) train_->restart();
  if (full_disks_) full_disks_->restart();
  if (generator_) generator_->start();
}

void CaptureNode::tell_cameras(const PulseEdge& edge) {
  pulse_times_.add(edge.pulse, edge.at);
  cameras_.pulse_at(edge);
}

void CaptureNode::tell_first_pulse() {
  if (first_pulse_told_ || sensor_ || !generator_) return;
  const auto first = generator_->first_pulse();
  if (!first) return;
  tell_cameras({.pulse = 0, .at = *first});
  first_pulse_told_ = true;
}

void CaptureNode::drain() {
  if (generator_) generator_->stop();
  cameras_.train_ended();
  drain_began_ = Monotonic::now();
}

void CaptureNode::disarm() {
  if (generator_) generator_->stop();
  cameras_.train_ended();
  learner_.reset();
  if (records_pulses()) {
    const Ledger ledger = finish();
    if (take_) std::exchange(take_, nullptr)->close(ledger);
  }
  pulses_.reset();
  cameras_.disarm();
  pulse_times_.end();
}

// --- what happens -------------------------------------------------------------------------------

std::optional<NodeReport> CaptureNode::poll(Phase phase) {
  for (const auto& camera : cameras_) camera_watch_.look_at(*camera);
  tell_first_pulse();
  try {
    switch (phase) {
      case Phase::kArming: {
        NodeReport report = poll_arming();
        if (report.text.empty()) return std::nullopt;
        return report;
      }
      case Phase::kLearning:
        return poll_learning();
      case Phase::kRecording:
        return poll_recording();
      case Phase::kDraining:
        return poll_draining();
      default:
        return std::nullopt;
    }
  } catch (const InputError& error) {
    return NodeReport{.event = Input::kFailed, .text = error.what(), .detail = {}};
  }
}

/// An empty text while it takes its time.
NodeReport CaptureNode::poll_arming() {
  if (is_arming_trigger()) return {.event = Input::kFailed, .text = "", .detail = {}};
  const std::string waiting = cameras_.not_ready(order_.allow_missing);
  if (!waiting.empty()) {
    const bool late = Monotonic::now() > ready_by_;
    if (late && checks()) {
      open_check();
      return {.event = Input::kReady, .text = "without " + waiting, .detail = {}};
    }
    return {.event = Input::kFailed, .text = late ? "not ready: " + waiting : "", .detail = {}};
  }
  if (checks()) {
    open_check();
    return {.event = Input::kReady, .text = "ready", .detail = {}};
  }
  if (order_.verb == CommandVerb::kArm) {
    refuse_unfit_disk(studio_.storage.takes, disk_demand());
    open_take();
  } else {
    listen_to_pulses({});
  }
  return {.event = Input::kReady, .text = ready_text(), .detail = {}};
}

std::optional<NodeReport> CaptureNode::poll_learning() {
  if (train_is_over()) {
    cameras_.train_ended();
    learner_->train_ended();
  }
  const auto result = learner_->poll();
  if (!result) return std::nullopt;
  return NodeReport{
      .event = result->learnt ? Input::kReady : Input::kFailed, .text = result->text, .detail = {}};
}

/// Where the trigger is elsewhere, as far as that node was heard.
bool CaptureNode::train_is_over() {
  if (generator_) return generator_->finished();
  train_->listen(order_.take);
  return train_->ended();
}

std::optional<NodeReport> CaptureNode::poll_recording() {
  const std::string full = look_at_disks();
  if (!full.empty()) return NodeReport{.event = Input::kTrainEnded, .text = full, .detail = {}};
  if (!train_is_over()) return std::nullopt;
  return NodeReport{.event = Input::kTrainEnded, .text = "pulses have ended", .detail = {}};
}

std::optional<NodeReport> CaptureNode::poll_draining() {
  if (train_) train_->listen(order_.take);
  if (!all_accounted_for() && Monotonic::now() < drain_began_ + kDrainWithin) return std::nullopt;
  if (check_) return check_report();
  const Ledger ledger = finish();
  const std::string broken = std::exchange(take_, nullptr)->close(ledger);
  return NodeReport{.event = broken.empty() ? Input::kDrained : Input::kBroken,
                    .text = broken.empty() ? ledger.verdict() : broken,
                    .detail = ledger_json(ledger)};
}

// --- the take -----------------------------------------------------------------------------------

void CaptureNode::open_take() {
  auto take = NodeTake::begin(of_this_node(), plan());
  listen_to_pulses(take->paths().pulses());
  take_ = std::move(take);
}

std::optional<CommandMessage> CaptureNode::rejoin() {
  // The node of the trigger made the pulses: with it, the train ended.
  if (!train_) return std::nullopt;
  const auto found = kept_orders_.running(*train_);
  if (!found) return std::nullopt;
  begin_order(found->order, std::nullopt);
  try {
    reopen_take(found->commanded);
  } catch (const InputError&) {
    cameras_.disarm();
    pulses_.reset();
    drop_order(studio_, node_, order_.take);
    throw;
  }
  events_.send(Severity::kWarning, "take",
               node_ + " was started anew and records " + order_.take + " again, from pulse " +
                   std::to_string(found->commanded) + " on",
               advice::kRejoined);
  return order_;
}

void CaptureNode::reopen_take(int64_t commanded) {
  const TakePaths paths = take_paths(studio_, order_.take);
  const EdgeTimes edges = edge_times(paths);
  PulseRecorder::Past past{.sensed = {}, .commanded = commanded};
  for (const auto& [pulse, edge] : edges) past.sensed.insert(pulse);
  auto take = NodeTake::go_on(of_this_node(), plan(), edges, edges_are_told());
  listen_to_pulses(paths.pulses(), std::move(past));
  train_->restart();
  take->save_as_open();
  take_ = std::move(take);
}

void CaptureNode::listen_to_pulses(const std::filesystem::path& log,
                                   std::optional<PulseRecorder::Past> past) {
  pulses_ = std::make_unique<PulseRecorder>(
      sensor_.get(), bus_,
      PulseRecorder::Setup{.take = order_.take,
                           .train = pulse_train_,
                           .log = log,
                           .on_edge = [this](const PulseEdge& edge) { tell_cameras(edge); },
                           .past = std::move(past)});
}

void CaptureNode::open_check() {
  const std::vector<CameraWorker*> ready = cameras_.ready();
  listen_to_pulses({});
  check_ = std::make_unique<CameraCheck>(
      ready, CameraCheck::Setup{.rate_hz = rate_hz_, .background = studio_.storage.background},
      bus_);
}

NodeReport CaptureNode::check_report() {
  const std::vector<CheckedCamera> cameras = check_->close(commanded());
  std::vector<std::string> not_ready;
  for (const auto& camera : cameras_) {
    const bool seen = std::any_of(cameras.begin(), cameras.end(), [&](const CheckedCamera& c) {
      return c.pulses.name == camera->camera();
    });
    if (!seen) not_ready.push_back(camera->camera());
  }
  const Ledger ledger = finish();
  return {.event = Input::kDrained,
          .text = "looked at " + std::to_string(cameras.size()) + " cameras",
          .detail = check_json(ledger, cameras, not_ready)};
}

Ledger CaptureNode::finish() {
  Ledger ledger;
  ledger.commanded = commanded();
  // Who only listens to the trigger's node, and missed a word of it, cannot tell what was sensed.
  const bool knows = sensor_ || pulses_->sensed() >= ledger.commanded;
  if (studio_.trigger.is_sensed() && knows) pulses_->put_into(ledger, ledger.commanded);
  if (take_) take_->end(ledger);
  totals_ = totals();
  check_.reset();
  pulses_.reset();
  return ledger;
}

bool CaptureNode::only_sensor_counts() const {
  return generator_ && sensor_ && !generator_->counts_exactly();
}

int64_t CaptureNode::commanded() const {
  if (only_sensor_counts()) return pulses_->seen();
  // Elsewhere, the last pulses may have been left out, or their messages lost.
  return generator_ ? generator_->commanded() : std::max(pulses_->seen(), train_->commanded());
}

bool CaptureNode::all_accounted_for() const {
  const MonotonicInstant now = Monotonic::now();
  const Duration quiet = std::min<Duration>(kLongestQuiet, 10 * period_of(rate_hz_));
  const bool silent = now - drain_began_ > quiet;
  if (generator_ && pulses_->sensed() < commanded() && !silent) return false;
  // A pulse that was under way when they were turned off is known of at its end.
  const Duration width = from_seconds(studio_.trigger.pulse_width_us * 1e-6);
  if (only_sensor_counts() && now - drain_began_ < width + kSensedWithin) return false;
  // Elsewhere the last pulses may not have been heard of yet.
  if (!generator_ && !silent) return false;
  if (check_ && !check_->has(commanded()) && !silent) return false;
  return !take_ || take_->has_all(commanded(), silent ? std::optional(now - quiet) : std::nullopt);
}

// --- readiness ----------------------------------------------------------------------------------

double CaptureNode::bytes_per_second() const {
  return cameras_.bytes_per_pulse() * (rate_hz_ > 0 ? rate_hz_ : studio_.trigger.rate_hz);
}

DiskDemand CaptureNode::disk_demand() const {
  return {.rate_hz = rate_hz_,
          .bytes_per_pulse = cameras_.bytes_per_pulse(),
          .pulses = order_.pulses > 0 ? std::optional(order_.pulses) : std::nullopt,
          .queue_frames = NodeCameras::kQueueFrames};
}

std::string CaptureNode::look_at_disks() {
  if (!take_) return "";
  events_.keep_told(Severity::kAlarm, "queue", take_->queue_trouble(), advice::kQueue);
  const std::string here = take_->disk_must_end();
  disk_is_full_ = !here.empty();
  const std::string elsewhere = full_disks_ ? full_disks_->full_node() : "";
  if (here.empty() && elsewhere.empty()) return "";
  const std::string why = disk_is_full_ ? here : "the disk of " + elsewhere + " is full or broken";
  events_.send(Severity::kAlarm, "take", order_.take + " was ended: " + why, advice::kTakeEnded);
  return why;
}

std::string CaptureNode::ready_text() const {
  constexpr double kFiveMinutes = 300;
  std::string text = std::to_string(cameras_.ready().size()) + " cameras streaming and quiet, " +
                     format_bytes(bytes_per_second() * kFiveMinutes) + " for 5 min, " +
                     format_bytes(disk_free_bytes(studio_)) + " free";
  if (!generator_) return text;
  return text + (sensor_ ? ", trigger here" : ", trigger here, not sensed");
}

// --- health -------------------------------------------------------------------------------------

std::string CaptureNode::trouble() const {
  std::vector<std::string> lines;
  if (generator_ && !generator_->fault().empty())
    lines.push_back("trigger: " + generator_->fault());
  if (sensor_ && !sensor_->fault().empty()) lines.push_back("sense line: " + sensor_->fault());
  if (const std::string text = cameras_.trouble(); !text.empty()) lines.push_back(text);
  return fmt::format("{}", fmt::join(lines, "; "));
}

/// Of the open take, else of the last one.
CaptureNode::TakeTotals CaptureNode::totals() const {
  if (!records_pulses()) return totals_;
  return {.frames = take_ ? take_->counts() : LaneCounts{},
          .pulses_not_live = take_ ? take_->pulses_not_live() : 0,
          .sensed = pulses_->sensed(),
          .commanded = commanded()};
}

void CaptureNode::report_health(HealthMessage& health) {
  health.text = trouble();
  health.values["cameras"] = static_cast<double>(cameras_.size());
  health.values["disk_free_bytes"] = disk_free_bytes(studio_);
  if (const double bytes = bytes_per_second(); bytes > 0) {
    health.values["disk_seconds_left"] = disk_free_bytes(studio_) / bytes;
  }
  const TakeTotals sum = totals();
  health.values["frames_received"] = static_cast<double>(sum.frames.received);
  health.values["frames_written"] = static_cast<double>(sum.frames.written);
  health.values["frames_published"] = static_cast<double>(sum.frames.published);
  health.values["pulses_not_live"] = static_cast<double>(sum.pulses_not_live);
  health.values["write_errors"] = static_cast<double>(sum.frames.write_errors);
  health.values["pulses_lost"] = pulses_ ? static_cast<double>(pulses_->lost()) : 0;
  if (sum.frames.write_errors > 0) health.text = "frames could not be written: the disk refuses";
  health.values[kDiskFull] = disk_is_full_ ? 1 : 0;
  tell_troubles(sum);
  if (studio_.trigger.is_sensed()) {
    health.values["pulses_sensed"] = static_cast<double>(sum.sensed);
  }
  health.values["pulses_commanded"] = static_cast<double>(sum.commanded);
  if (generator_) {
    const PulseStatistics pulses = generator_->statistics();
    health.values["trigger_jitter_p50_us"] = 1e6 * to_seconds(pulses.jitter_p50);
    health.values["trigger_jitter_p99_us"] = 1e6 * to_seconds(pulses.jitter_p99);
    health.values["trigger_jitter_max_us"] = 1e6 * to_seconds(pulses.jitter_max);
    health.values["trigger_late"] = static_cast<double>(pulses.late);
  }
  health.values["frames_missing"] = 0;
  health.values["frames_suspect"] = 0;
  health.values["cameras_streaming"] = 0;
  health.values["queue_frames"] = 0;
  const int64_t due = records_pulses() ? std::max<int64_t>(0, commanded() - kLatePeriods) : 0;
  for (const auto& camera : cameras_) camera_watch_.report(*camera, due, health);
}

void CaptureNode::tell_troubles(const TakeTotals& sum) {
  if (take_) events_.keep_told(Severity::kAlarm, "disk", take_->disk_trouble(), advice::kDisk);
  events_.keep_told(Severity::kAlarm, "trigger", trigger_trouble(sum), advice::kTrigger);
  events_.keep_told(Severity::kAlarm, "sense line",
                    sensor_ && records_pulses() ? sensor_->fault() : "", advice::kSenseLine);
  events_.keep_told(Severity::kWarning, "pulses",
                    sensor_ && records_pulses() ? pulses_->trouble() : "", advice::kPulses);
  events_.keep_told(Severity::kWarning, "live picture",
                    sum.pulses_not_live == 0
                        ? ""
                        : format_count(sum.pulses_not_live) +
                              " pulses not live: this machine is busy recording them",
                    advice::kLivePicture);
}

std::string CaptureNode::trigger_trouble(const TakeTotals& sum) const {
  if (generator_ && !generator_->fault().empty()) return generator_->fault();
  const int64_t unseen = sum.commanded - kLatePeriods - sum.sensed;
  if (!sensor_ || !records_pulses() || unseen <= 0) return "";
  return format_count(sum.commanded - sum.sensed) + " pulses commanded and not sensed";
}

bool CaptureNode::progressed_since(MonotonicInstant since) const {
  return (!take_ || take_->progressed_since(since)) &&
         (!pulses_ || pulses_->progressed_since(since)) &&
         (!learner_ || learner_->progressed_since(since)) &&
         (!check_ || check_->progressed_since(since));
}

}  // namespace v3d
