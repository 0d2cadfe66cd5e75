#include "daemon/captured/capture_node.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <map>
#include <thread>

#include "base/config/studio_values.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "daemon/captured/node_sound.h"
#include "daemon/control/reply_json.h"
#include "daemon/node/advice.h"
#include "daemon/node/service.h"
#include "daemon/node/take_folder.h"
#include "trigger/pulse_generator.h"

namespace v3d::captured {
namespace {

constexpr Duration kReadyTimeout = std::chrono::seconds(15);
constexpr int64_t kDefaultPlates = 16;
constexpr int64_t kDefaultCheckPulses = 100;
/// A check waits no longer for a camera, because it reports missing cameras.
constexpr Duration kCheckReadyTimeout = std::chrono::seconds(5);
/// A frame that is this many periods late counts as missing in health.
constexpr int64_t kLatePeriods = 5;

std::vector<std::string> other_capture_nodes(const Studio& studio, const std::string& node) {
  std::vector<std::string> others;
  for (const StudioNode& other : studio.nodes) {
    if (other.name != node && !studio.cameras_of(other.name).empty()) others.push_back(other.name);
  }
  return others;
}

/// The path of a program in the folder of this one.
std::filesystem::path sibling_program(const char* name) {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path() / name;
}

}  // namespace

CaptureNode::CaptureNode(const Studio& studio, const std::string& node, bus::Bus& bus)
    : studio_(studio),
      node_(node),
      bus_(bus),
      events_(bus, node),
      camera_monitor_(events_),
      camera_settings_(studio.storage.takes / (".camera-settings-" + node + ".toml")),
      pulse_times_(period_of(studio.trigger.rate_hz)),
      trigger_(studio, node, bus),
      persisted_commands_(studio, node),
      cameras_(studio, node, pulse_times_),
      slots_(static_cast<int>(std::max(1U, std::thread::hardware_concurrency()))),
      signer_(studio, node),
      recovered_takes_(studio, node),
      rejoin_(studio, node_, persisted_commands_, recovered_takes_, events_) {
  if (cameras_.size() == 0 && !trigger_.is_here()) {
    throw InputError(studio.path.string() + ": node '" + node +
                     "' has neither a camera nor the trigger; expected one with either");
  }
  plan_.train.rate_hz = studio.trigger.rate_hz;
  TimecodeSource timecode;
  if (trigger_.is_here() && studio.timecode_output) {
    timecode_ = std::make_unique<TimecodeOutput>(*studio.timecode_output);
    timecode = [output = timecode_.get()] { return output->clock(); };
  }
  if (studio.lights && studio.lights->node == node) {
    lights_ = std::make_unique<LightOutput>(*studio.lights, sibling_program("v3d-lights"));
  }
  if (const StudioSound* const sound = studio.sound_of(node)) {
    sound_ = std::make_unique<NodeSound>(*sound, studio.trigger.wire, std::move(timecode));
  }
  if (trigger_.is_here()) {
    const std::vector<std::string> others = other_capture_nodes(studio, node);
    disk_monitor_ = std::make_unique<node::DiskMonitor>(bus, others);
    firmware_monitor_ = std::make_unique<FirmwareMonitor>(bus, others);
  }
}

CaptureNode::~CaptureNode() { disarm(); }

// --- commands -----------------------------------------------------------------------------------

void CaptureNode::set_signing_key(const wire::SigningKey& key) {
  signer_.set_key(key);
  recovered_takes_.search(signer_.signer());
}

void CaptureNode::arm(const wire::CommandMessage& order) {
  if (order.verb == wire::CommandVerb::kCheck) {
    prepare(order, order.pulses > 0 ? order.pulses : kDefaultCheckPulses);
    return;
  }
  node::check_new_take(studio_, order.take);
  cameras_.check_prepared(order.allow_missing);
  prepare(order, order.pulses > 0 ? std::optional(order.pulses) : std::nullopt);
}

void CaptureNode::learn(const wire::CommandMessage& order) {
  prepare(order, order.pulses > 0 ? order.pulses : kDefaultPlates);
}

void CaptureNode::reset_for_order(const wire::CommandMessage& order,
                                  std::optional<int64_t> pulses) {
  plan_ = {.order = order,
           .train = {.rate_hz = order.rate_hz > 0 ? order.rate_hz : studio_.trigger.rate_hz,
                     .width = from_seconds(studio_.trigger.pulse_width_us * 1e-6),
                     .count = pulses}};
  pulse_times_.begin(period_of(plan_.train.rate_hz));
  if (timecode_) timecode_->begin_train(plan_.train.rate_hz);
  camera_monitor_.reset();
  disk_is_full_ = false;
  cameras_armed_ = false;
}

void CaptureNode::prepare(const wire::CommandMessage& order, std::optional<int64_t> pulses) {
  check_order(order);
  rejoin_.cancel();
  persisted_commands_.drop_all();
  reset_for_order(order, pulses);
  if (lights_) lights_->show(LightOutput::Scene::kTake);
  trigger_.arm(plan_.train);
  if (!trigger_.is_here()) arm_cameras();
}

/// Call when the generator is armed: edges on its output before that are no pulses of the train.
void CaptureNode::arm_cameras() {
  const Duration period = period_of(plan_.train.rate_hz);
  cameras_.arm(period, trigger_.reports_edges());
  cameras_armed_ = true;
  ready_by_ = Monotonic::now() + (is_check() ? kCheckReadyTimeout : kReadyTimeout) + 2 * period;
}

bool CaptureNode::trigger_is_arming() {
  if (cameras_armed_) return false;
  if (!trigger_.armed()) return true;
  arm_cameras();
  return false;
}

void CaptureNode::start() {
  take_->start();
  if (disk_monitor_) disk_monitor_->reset();
  trigger_.start();
}

void CaptureNode::drain() {
  trigger_.stop();
  take_->train_ended();
}

void CaptureNode::disarm() {
  trigger_.stop();
  cameras_.train_ended();
  if (take_has_ledger()) close_take();
  take_.reset();
  recovered_takes_.set_paused(false);
  cameras_.disarm();
  pulse_times_.end();
  if (lights_) lights_->show(LightOutput::Scene::kWork);
}

std::optional<wire::CommandMessage> CaptureNode::rejoin() {
  // The train ended with the daemon of the trigger's node.
  if (trigger_.is_here()) return std::nullopt;
  int64_t commanded = 0;
  try {
    auto resumed = rejoin_.poll(*trigger_.monitor());
    if (!resumed) return std::nullopt;
    reset_for_order(resumed->order, std::nullopt);
    commanded = resumed->commanded;
    take_ = ActiveTake::resume(take_context(), plan_, *std::move(resumed));
  } catch (const std::exception& error) {
    cameras_.disarm();
    rejoin_.fail(error.what());
    throw;
  }
  rejoin_.finish(commanded);
  recovered_takes_.set_paused(true);
  if (lights_) lights_->show(LightOutput::Scene::kTake);
  return plan_.order;
}

ActiveTake::Context CaptureNode::take_context() {
  return {{studio_, node_, bus_, cameras_, slots_, signer_.signer(), sound_.get()},
          trigger_,
          [this](const capture::PulseEdge& edge) { notify_cameras(edge); }};
}

void CaptureNode::notify_cameras(const capture::PulseEdge& edge) {
  cameras_.pulse_at(edge);
  // poll_recording() may be late, and until then cameras would report the silence as a loss.
  if (edge.pulse + 1 == plan_.train.count) cameras_.train_ended();
  if (!edge.is_timed) return;
  pulse_times_.add(edge.pulse, edge.at);
  notify_sound(edge);
}

// --- phases -------------------------------------------------------------------------------------

std::optional<control::NodeReport> CaptureNode::poll(control::Phase phase) {
  rejoin_.cancel_unless_polled();
  for (const auto& camera : cameras_) camera_monitor_.update(*camera);
  if (const auto edge = trigger_.unsensed_first_pulse()) notify_cameras(*edge);
  for (const auto& edge : trigger_.unsensed_pulses()) notify_sound(edge);
  try {
    switch (phase) {
      case control::Phase::kArming:
        return poll_arming();
      case control::Phase::kLearning:
        return poll_learning();
      case control::Phase::kRecording:
        return poll_recording();
      case control::Phase::kDraining:
        return poll_draining();
      default:
        return std::nullopt;
    }
  } catch (const InputError& error) {
    return control::NodeReport{
        .event = control::Input::kFailed, .text = error.what(), .detail = {}};
  }
}

std::optional<control::NodeReport> CaptureNode::poll_arming() {
  if (lights_ && !lights_->is_settled()) return std::nullopt;
  if (trigger_is_arming()) return std::nullopt;
  const std::string waiting = cameras_.not_ready(plan_.order.allow_missing);
  const bool late = Monotonic::now() > ready_by_;
  // A camera that may be missing is recorded when it works: it becomes ready with the others.
  if (!late && (!waiting.empty() || cameras_.are_settling())) return std::nullopt;
  if (!waiting.empty() && !is_check()) {
    return control::NodeReport{
        .event = control::Input::kFailed, .text = "not ready: " + waiting, .detail = {}};
  }
  clock_fault_ = cameras_.clock_fault();
  trigger_.set_clock_fault(clock_fault_);
  take_ = ActiveTake::begin(take_context(), plan_);
  recovered_takes_.set_paused(true);
  std::string text = is_check() ? "ready" : ready_text();
  if (!waiting.empty()) text = "without " + waiting;
  return control::NodeReport{
      .event = control::Input::kReady, .text = std::move(text), .detail = {}};
}

std::optional<control::NodeReport> CaptureNode::poll_learning() {
  const bool over = trigger_.train_has_ended(plan_.order.take);
  if (over) take_->train_ended();
  // The other nodes learn their background from the remaining pulses.
  if (trigger_.is_here() && !over) return std::nullopt;
  const auto result = take_->background_result();
  if (!result) return std::nullopt;
  return control::NodeReport{
      .event = result->succeeded ? control::Input::kReady : control::Input::kFailed,
      .text = result->text,
      .detail = {}};
}

std::optional<control::NodeReport> CaptureNode::poll_recording() {
  std::string reason = check_disks();
  if (reason.empty()) reason = check_length();
  if (reason.empty() && trigger_.train_has_ended(plan_.order.take)) reason = "pulses have ended";
  if (reason.empty()) return std::nullopt;
  return control::NodeReport{
      .event = control::Input::kTrainEnded, .text = std::move(reason), .detail = {}};
}

std::optional<control::NodeReport> CaptureNode::poll_draining() {
  trigger_.poll(plan_.order.take);
  if (!take_->is_drained()) return std::nullopt;
  const TakeResult result = close_take();
  if (is_check()) return check_report(result);
  const std::string& error = result.close_report.error;
  return control::NodeReport{
      .event = error.empty() ? control::Input::kDrained : control::Input::kBroken,
      .text = error.empty() ? result.ledger.verdict() : error,
      .detail = control::ledger_detail(result.ledger)};
}

TakeResult CaptureNode::close_take() {
  TakeResult result = std::exchange(take_, nullptr)->close();
  last_ = result.counts;
  if (!result.close_report.error.empty()) {
    events_.send(wire::Severity::kAlarm, "take", result.close_report.error,
                 node::advice::kStaysOpen);
  }
  if (!result.close_report.checksum_error.empty()) {
    events_.send(wire::Severity::kWarning, "take", result.close_report.checksum_error,
                 node::advice::kNoChecksum);
  }
  if (!result.close_report.quarantine_notice.empty()) {
    events_.send(wire::Severity::kInfo, "take", result.close_report.quarantine_notice,
                 node::advice::kQuarantined);
  }
  if (!result.close_report.signing_error.empty()) {
    events_.send(wire::Severity::kWarning, "take", result.close_report.signing_error,
                 node::advice::kUnsigned);
  }
  if (!result.close_report.pulse_log_error.empty()) {
    events_.send(wire::Severity::kWarning, "pulses", result.close_report.pulse_log_error,
                 node::advice::kPulseLog);
  }
  return result;
}

control::NodeReport CaptureNode::check_report(const TakeResult& result) const {
  std::vector<std::string> not_ready;
  for (const auto& camera : cameras_) {
    const bool seen = std::ranges::any_of(
        result.checked, [&](const CheckedCamera& c) { return c.pulses.name == camera->camera(); });
    if (!seen) not_ready.push_back(camera->camera());
  }
  return {.event = control::Input::kDrained,
          .text = "checked " + std::to_string(result.checked.size()) + " cameras",
          .detail = check_json({.ledger = result.ledger,
                                .rate_hz = plan_.train.rate_hz,
                                .cameras = result.checked,
                                .not_ready = not_ready,
                                .sound = result.sound})};
}

// --- disks and readiness ------------------------------------------------------------------------

double CaptureNode::bytes_per_second() const {
  return cameras_.bytes_per_pulse() * plan_.train.rate_hz;
}

std::string CaptureNode::check_disks() {
  NodeTake* const recording = take_->recording();
  if (recording == nullptr) return "";
  events_.report_condition(wire::Severity::kAlarm, "queue", recording->queue_warning(),
                           node::advice::kQueue);
  const std::string here = recording->disk_stop_reason();
  disk_is_full_ = !here.empty();
  const std::string elsewhere = disk_monitor_ ? disk_monitor_->full_node(plan_.order.take) : "";
  if (here.empty() && elsewhere.empty()) return "";
  const std::string why = disk_is_full_ ? here : "the disk of " + elsewhere + " is full or broken";
  events_.send(wire::Severity::kAlarm, "take", plan_.order.take + " was stopped: " + why,
               node::advice::kTakeEnded);
  return why;
}

std::string CaptureNode::check_length() {
  const std::string why = length_stop_reason(plan_.train, take_->counts().commanded);
  if (!why.empty()) {
    events_.send(wire::Severity::kAlarm, "take", plan_.order.take + " was stopped: " + why,
                 node::advice::kTakeIsLong);
  }
  return why;
}

std::string CaptureNode::ready_text() const {
  constexpr double kFiveMinutes = 300;
  const io::Result<double> free = node::disk_free_bytes(studio_);
  const NodeTake* const recording = take_->recording();
  const size_t cameras = recording != nullptr ? recording->camera_count() : cameras_.ready().size();
  std::string text = std::to_string(cameras) + " cameras streaming and quiet, " +
                     format_bytes(bytes_per_second() * kFiveMinutes) + " for 5 min, " +
                     (free ? format_bytes(*free) : "an unknown number of bytes") + " free";
  if (!trigger_.is_here()) return text;
  text += trigger_.sensor() != nullptr ? ", trigger here" : ", trigger here, not sensed";
  return clock_fault_.empty() ? text : text + "; unscheduled action commands: " + clock_fault_;
}

// --- health -------------------------------------------------------------------------------------

std::string CaptureNode::fault_text() const {
  std::vector<std::string> lines = trigger_.problems(take_ != nullptr);
  if (const std::string text = rejoin_.text(); !text.empty()) lines.push_back(text);
  if (const std::string text = cameras_.fault_text(); !text.empty()) lines.push_back(text);
  return fmt::format("{}", fmt::join(lines, "; "));
}

void CaptureNode::report_health(wire::HealthMessage& health) {
  trigger_.retry_stop();
  for (const std::string& line : std::exchange(open_takes_, {})) {
    events_.send(wire::Severity::kAlarm, "take", line, node::advice::kStaysOpen);
  }
  health.text = fault_text();
  health.values["cameras"] = static_cast<double>(cameras_.size());
  const io::Result<double> free = node::disk_free_bytes(studio_);
  node::report_free_space(free, health);
  if (const double bytes = bytes_per_second(); free && bytes > 0) {
    health.values["disk_seconds_left"] = *free / bytes;
  }
  const TakeCounts counts = take_counts();
  report_take(counts, health);
  report_warnings(counts);
  report_signed_takes(health);
  trigger_.report(health);
  if (sound_) report_sound(sound_->status(), health, events_);
  if (timecode_) report_timecode_output(timecode_->status(), health, events_);
  if (lights_) report_lights(health);
  health.values["frames_missing"] = 0;
  health.values["frames_suspect"] = 0;
  health.values["cameras_streaming"] = 0;
  health.values["queue_frames"] = 0;
  const int64_t due = std::max<int64_t>(0, counts.commanded - kLatePeriods);
  std::map<std::string, capture::CameraWorkerStatus> cameras;
  for (const auto& camera : cameras_) {
    const bool is_counted = take_ && take_->counts_frames_of(camera->camera());
    camera_monitor_.report(*camera, is_counted ? due : 0, health);
    cameras.emplace(camera->camera(), camera->status());
  }
  if (!cameras.empty()) camera_settings_.update(camera_settings_text(node_, cameras));
  if (firmware_monitor_) {
    events_.report_condition(wire::Severity::kWarning, "firmware",
                             firmware_monitor_->differences(health), node::advice::kFirmware);
  }
}

void CaptureNode::report_lights(wire::HealthMessage& health) {
  const LightOutput::Status status = lights_->status();
  health.values["lights_connected_flag"] = status.is_connected ? 1 : 0;
  health.values["take_light_flag"] = status.scene == LightOutput::Scene::kTake ? 1 : 0;
  events_.report_condition(wire::Severity::kWarning, "lights", status.fault, node::advice::kLights);
}

void CaptureNode::report_take(const TakeCounts& counts, wire::HealthMessage& health) const {
  const auto value = [&](const char* name, int64_t n) {
    health.values[name] = static_cast<double>(n);
  };
  value("frames_received", counts.frames.received);
  value("frames_written", counts.frames.written);
  value("frames_published", counts.frames.published);
  value("pulses_not_live", counts.pulses_not_live);
  value("write_errors", counts.frames.write_errors);
  value("pulses_lost", take_ ? take_->pulses().lost_messages() : 0);
  value("pulses_commanded", counts.commanded);
  if (studio_.trigger.is_sensed()) value("pulses_sensed", counts.sensed);
  value(node::kDiskFull, disk_is_full_ ? 1 : 0);
  if (counts.frames.write_errors > 0) {
    health.text = "frames could not be written: the disk is full or broken";
  }
}

void CaptureNode::report_warnings(const TakeCounts& counts) {
  NodeTake* const recording = take_ ? take_->recording() : nullptr;
  if (recording != nullptr) {
    events_.report_condition(wire::Severity::kAlarm, "disk", recording->disk_warning(),
                             node::advice::kDisk);
  } else {
    events_.report_condition(wire::Severity::kAlarm, "disk", folder_fault(studio_.storage.takes),
                             node::advice::kTakesFolder);
  }
  events_.report_condition(wire::Severity::kWarning, "signing key", signer_.warning(),
                           node::advice::kSigningKey);
  const bool senses = trigger_.sensor() != nullptr && take_has_ledger();
  events_.report_condition(wire::Severity::kAlarm, "trigger", trigger_warning(counts),
                           node::advice::kTrigger);
  events_.report_condition(wire::Severity::kWarning, "action commands", trigger_.warning(),
                           node::advice::kActionCommands);
  events_.report_condition(wire::Severity::kAlarm, "sense line",
                           senses ? trigger_.sensor_fault() : "", node::advice::kSenseLine);
  events_.report_condition(wire::Severity::kWarning, "pulses",
                           senses ? take_->pulses().warning() : "", node::advice::kPulses);
  events_.report_condition(wire::Severity::kWarning, "live picture",
                           counts.pulses_not_live == 0
                               ? ""
                               : format_count(counts.pulses_not_live) +
                                     " pulses without live picture: this PC is busy recording them",
                           node::advice::kLivePicture);
}

void CaptureNode::report_signed_takes(wire::HealthMessage& health) {
  health.values["takes_to_sign"] = static_cast<double>(recovered_takes_.pending());
  for (const RecoveredTakeSigner::Result& result : recovered_takes_.results()) {
    if (result.error.empty()) {
      events_.send(wire::Severity::kInfo, "take", result.take + " is signed, after its recovery",
                   "");
    } else {
      events_.send(wire::Severity::kWarning, "take",
                   "a recovered take is not signed: " + result.error,
                   node::advice::kRecoveredUnsigned);
    }
  }
}

std::string CaptureNode::trigger_warning(const TakeCounts& counts) const {
  if (const std::string fault = trigger_.fault(); !fault.empty()) return fault;
  return take_has_ledger() ? trigger_.unsensed_warning(counts.sensed) : "";
}

bool CaptureNode::progressed_since(MonotonicInstant since) const {
  return !take_ || take_->progressed_since(since);
}

}  // namespace v3d::captured
