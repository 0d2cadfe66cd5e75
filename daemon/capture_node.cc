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
constexpr int64_t kDefaultPlates = 16;
constexpr int64_t kDefaultCheckPulses = 100;
/// A check waits no longer for a camera: it is to tell which ones are not there.
constexpr Duration kCheckReadyWithin = std::chrono::seconds(5);
constexpr int64_t kMinPlates = 2;
constexpr int64_t kMaxPlates = 256;  // they are all in memory at once
/// A frame later than so many periods counts as missing in health.
constexpr int64_t kLatePeriods = 5;
/// More frames behind one camera than a hiccup explains: the live picture waits.
constexpr int64_t kLiveBacklog = 5;

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
  kept_orders_.forget();
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

void CaptureNode::start() {
  first_pulse_told_ = false;
  if (order_.verb == CommandVerb::kBackground) {
    const int64_t plates = order_.pulses > 0 ? order_.pulses : kDefaultPlates;
    learner_ = std::make_unique<BackgroundLearner>(
        cameras_.ready(),
        LearnPlan{.plates = plates,
                  .limit = (plates + 2) * period_of(rate_hz_) + kReadyWithin,
                  .folder = studio_.storage.background,
                  .rate_hz = rate_hz_},
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
  if (!take_is_open()) pulses_.reset();
  if (take_is_open()) {
    const Ledger ledger = finish_take();
    if (!checks()) {
      close_take(studio_, info_, ledger);
      discard_if_empty(ledger);
    }
  }
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
  const Ledger ledger = finish_take();
  const auto broken = [&](const std::string& text) {
    return NodeReport{.event = Input::kBroken, .text = text, .detail = ledger_json(ledger)};
  };
  if (!close_take(studio_, info_, ledger)) {
    return broken("cannot write the ledger of " + ledger.take + " to " +
                  studio_.storage.takes.string());
  }
  if (!unkept_.empty()) {
    return broken(studio_.storage.takes.string() + " did not keep the last frames of " +
                  fmt::format("{}", fmt::join(unkept_, ", ")) + ": v3dctl verify tells which");
  }
  discard_if_empty(ledger);
  return NodeReport{
      .event = Input::kDrained, .text = ledger.verdict(), .detail = ledger_json(ledger)};
}

// --- the take -----------------------------------------------------------------------------------

void CaptureNode::open_take() {
  const std::vector<CameraWorker*> ready = cameras_.ready();
  info_ = {.name = order_.take,
           .studio = studio_.name,
           .rate_hz = rate_hz_,
           .pulses = 0,
           .state = TakeState::kRecording,
           .software_version = V3D_VERSION,
           .started = Realtime::now(),
           .cameras = {}};
  for (const CameraWorker* worker : ready) info_.cameras.push_back(worker->camera());
  create_take(studio_, info_);
  keep_order(studio_, node_, order_);
  const TakePaths paths = take_paths(studio_, info_.name);
  listen_to_pulses(paths.pulses());
  disk_ = std::make_unique<TakeDisk>(paths, disk_demand());
  gate_ = std::make_unique<LiveGate>([this] { return cameras_.most_waiting(); }, kLiveBacklog);
  for (CameraWorker* worker : ready) {
    lanes_.push_back(std::make_unique<CameraLane>(
        *worker,
        CameraLane::Setup{.take = info_.name,
                          .log = paths.frames(worker->camera()),
                          .segmenter = Segmenter(cameras_.background_of(*worker), {}),
                          .rate_hz = rate_hz_},
        CameraLane::Shared{bus_, places_, *gate_}));
  }
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
    leave_take();
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
  info_ = load_take_info(paths);
  info_.state = TakeState::kRecording;
  const EdgeTimes edges = edge_times(paths);
  PulseRecorder::Past past{.sensed = {}, .commanded = commanded};
  for (const auto& [pulse, edge] : edges) past.sensed.insert(pulse);
  disk_ = std::make_unique<TakeDisk>(paths, disk_demand());
  gate_ = std::make_unique<LiveGate>([this] { return cameras_.most_waiting(); }, kLiveBacklog);
  for (const auto& worker : cameras_) {
    const auto& names = info_.cameras;
    const bool records = std::find(names.begin(), names.end(), worker->camera()) != names.end();
    if (records) reopen_lane(*worker, paths, edges);
  }
  listen_to_pulses(paths.pulses(), std::move(past));
  train_->restart();
  save_take_info(paths, info_);
}

void CaptureNode::reopen_lane(CameraWorker& worker, const TakePaths& paths,
                              const EdgeTimes& edges) {
  LanePast past = read_lane_past(paths, worker.camera(), edges);
  worker.rejoin(period_of(rate_hz_), edges_are_told(), past.camera);
  lanes_.push_back(std::make_unique<CameraLane>(
      worker,
      CameraLane::Setup{
          .take = info_.name,
          .log = paths.frames(worker.camera()),
          .segmenter = Segmenter(load_background(paths.background(), worker.camera()), {}),
          .rate_hz = rate_hz_,
          .past = std::move(past)},
      CameraLane::Shared{bus_, places_, *gate_}));
}

void CaptureNode::leave_take() {
  cameras_.disarm();
  lanes_.clear();
  pulses_.reset();
  gate_.reset();
  disk_.reset();
  drop_order(studio_, node_, order_.take);
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
  gate_ = std::make_unique<LiveGate>([this] { return cameras_.most_waiting(); }, kLiveBacklog);
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
  const Ledger ledger = finish_take();
  return {.event = Input::kDrained,
          .text = "looked at " + std::to_string(cameras.size()) + " cameras",
          .detail = check_json(ledger, cameras, not_ready)};
}

Ledger CaptureNode::finish_take() {
  Ledger ledger;
  ledger.take = info_.name;
  ledger.commanded = commanded();
  // Who only listens to the trigger's node, and missed a word of it, cannot tell what was sensed.
  const bool knows = sensor_ || pulses_->sensed() >= ledger.commanded;
  if (studio_.trigger.is_sensed() && knows) pulses_->put_into(ledger, ledger.commanded);
  unkept_.clear();
  for (const auto& lane : lanes_) {
    ledger.cameras.push_back(lane->close(ledger.commanded));
    if (!lane->is_kept()) unkept_.push_back(lane->camera());
  }
  totals_ = totals();
  // A daemon that is told to end while pulses run may be back before they end.
  if (!stop_requested()) drop_order(studio_, node_, info_.name);
  disk_.reset();
  lanes_.clear();
  check_.reset();
  gate_.reset();
  pulses_.reset();
  return ledger;
}

/// A take that was armed and never saw a pulse leaves nothing behind.
void CaptureNode::discard_if_empty(const Ledger& ledger) {
  if (ledger.commanded != 0 || ledger.sensed.value_or(0) != 0) return;
  std::error_code error;
  std::filesystem::remove_all(take_paths(studio_, info_.name).folder, error);
}

int64_t CaptureNode::commanded() const {
  if (generator_ && sensor_ && !generator_->counts_exactly()) return pulses_->seen();
  // Elsewhere, the last pulses may have been left out, or their messages lost.
  return generator_ ? generator_->commanded() : std::max(pulses_->seen(), train_->commanded());
}

bool CaptureNode::all_accounted_for() const {
  const MonotonicInstant now = Monotonic::now();
  const Duration quiet = std::min<Duration>(kLongestQuiet, 10 * period_of(rate_hz_));
  const bool silent = now - drain_began_ > quiet;
  if (generator_ && pulses_->sensed() < commanded() && !silent) return false;
  // Elsewhere the last pulses may not have been heard of yet.
  if (!generator_ && !silent) return false;
  if (check_ && !check_->has(commanded()) && !silent) return false;
  return std::all_of(lanes_.begin(), lanes_.end(), [&](const auto& lane) {
    return lane->counts().received >= commanded() || (silent && lane->quiet_since(now - quiet));
  });
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

DiskProgress CaptureNode::disk_progress() const {
  return {.dropped = cameras_.dropped(), .refused = totals().frames.write_errors};
}

std::string CaptureNode::look_at_disks() {
  if (!disk_) return "";
  events_.keep_told(Severity::kAlarm, "queue", disk_->queue_trouble(cameras_.most_waiting()),
                    advice::kQueue);
  const std::string here = disk_->must_end(disk_progress());
  disk_is_full_ = !here.empty();
  const std::string elsewhere = full_disks_ ? full_disks_->full_node() : "";
  if (here.empty() && elsewhere.empty()) return "";
  const std::string why = disk_is_full_ ? here : "the disk of " + elsewhere + " is full or broken";
  events_.send(Severity::kAlarm, "take", info_.name + " was ended: " + why, advice::kTakeEnded);
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
  if (!take_is_open()) return totals_;
  TakeTotals sum{.frames = {},
                 .pulses_not_live = gate_->skipped(),
                 .sensed = pulses_->sensed(),
                 .commanded = commanded()};
  for (const auto& lane : lanes_) {
    const LaneCounts counts = lane->counts();
    sum.frames.received += counts.received;
    sum.frames.written += counts.written;
    sum.frames.write_errors += counts.write_errors;
    sum.frames.published += counts.published;
  }
  return sum;
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
  const int64_t due = take_is_open() ? std::max<int64_t>(0, commanded() - kLatePeriods) : 0;
  for (const auto& camera : cameras_) camera_watch_.report(*camera, due, health);
}

void CaptureNode::tell_troubles(const TakeTotals& sum) {
  if (disk_) {
    events_.keep_told(Severity::kAlarm, "disk", disk_->trouble(disk_progress()), advice::kDisk);
  }
  events_.keep_told(Severity::kAlarm, "trigger", trigger_trouble(sum), advice::kTrigger);
  events_.keep_told(Severity::kAlarm, "sense line",
                    sensor_ && take_is_open() ? sensor_->fault() : "", advice::kSenseLine);
  events_.keep_told(Severity::kWarning, "pulses",
                    sensor_ && take_is_open() ? pulses_->trouble() : "", advice::kPulses);
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
  if (!sensor_ || !take_is_open() || unseen <= 0) return "";
  return format_count(sum.commanded - sum.sensed) + " pulses commanded and not sensed";
}

bool CaptureNode::progressed_since(MonotonicInstant since) const {
  const bool lanes = std::all_of(lanes_.begin(), lanes_.end(),
                                 [&](const auto& lane) { return lane->progressed_since(since); });
  return lanes && (!pulses_ || pulses_->progressed_since(since)) &&
         (!learner_ || learner_->progressed_since(since)) &&
         (!check_ || check_->progressed_since(since));
}

}  // namespace v3d
