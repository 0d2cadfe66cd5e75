#include "daemon/captured/capture_node.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <thread>

#include "base/error.h"
#include "base/pulse_rate.h"
#include "base/units.h"
#include "daemon/captured/check_json.h"
#include "daemon/control/reply_json.h"
#include "daemon/node/advice.h"
#include "daemon/node/service.h"
#include "daemon/node/take_folder.h"
#include "trigger/pulse_train.h"

namespace v3d {
namespace {

constexpr Duration kReadyWithin = std::chrono::seconds(15);
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
  if (order.rate_hz != 0 && !is_pulse_rate(order.rate_hz)) {
    throw InputError(impossible_pulse_rate(order.rate_hz));
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

/// The signing key of this node, where the studio file names one. Throws InputError when the studio
/// file lists another public key for the node: its signatures would be rejected.
std::optional<TakeSigner> signer_of(const Studio& studio, const std::string& node) {
  if (studio.storage.signing_key.empty()) return std::nullopt;
  TakeSigner signer{node, SigningKey::load(studio.storage.signing_key)};
  const auto own = std::ranges::find(studio.nodes, node, &StudioNode::name);
  const std::string listed = own == studio.nodes.end() ? "" : own->public_key;
  const std::string key = signer.key.public_key().text();
  if (!listed.empty() && listed != key) {
    throw InputError(studio.storage.signing_key.string() + ": its public key is " + key + ", but " +
                     studio.path.string() + " has another for node " + node);
  }
  return signer;
}

}  // namespace

CaptureNode::CaptureNode(const Studio& studio, const std::string& node, Bus& bus)
    : studio_(studio),
      node_(node),
      bus_(bus),
      events_(bus, node),
      camera_watch_(events_),
      pulse_times_(period_of(studio.trigger.rate_hz)),
      trigger_(studio, node, bus),
      kept_orders_(studio, node),
      cameras_(studio, node, pulse_times_),
      places_(static_cast<int>(std::max(1U, std::thread::hardware_concurrency()))),
      signer_(signer_of(studio, node)) {
  if (cameras_.size() == 0 && !trigger_.is_here()) {
    throw InputError(studio.path.string() + ": node '" + node +
                     "' has neither a camera nor the trigger; v3d-captured has nothing to do here");
  }
  plan_.train.rate_hz = studio.trigger.rate_hz;
  if (trigger_.is_here()) {
    full_disks_ = std::make_unique<DiskMonitor>(bus, other_capture_nodes(studio, node));
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
  plan_ = {.order = order,
           .train = {.rate_hz = order.rate_hz > 0 ? order.rate_hz : studio_.trigger.rate_hz,
                     .width = from_seconds(studio_.trigger.pulse_width_us * 1e-6),
                     .count = pulses}};
  pulse_times_.begin(period_of(plan_.train.rate_hz));
  camera_watch_.begin_train();
  disk_is_full_ = false;
  cameras_armed_ = false;
}

void CaptureNode::make_ready(const CommandMessage& order, std::optional<int64_t> pulses) {
  refuse_absurd(order);
  kept_orders_.forget();
  begin_order(order, pulses);
  if (trigger_.is_here()) {
    trigger_.arm(plan_.train);
  } else {
    arm_cameras();
  }
}

/// Not before the generator is armed: what it does until then is no pulse of the train.
void CaptureNode::arm_cameras() {
  const Duration period = period_of(plan_.train.rate_hz);
  cameras_.arm(period, trigger_.tells_edges());
  cameras_armed_ = true;
  ready_by_ = Monotonic::now() + (checks() ? kCheckReadyWithin : kReadyWithin) + 2 * period;
}

bool CaptureNode::is_arming_trigger() {
  if (cameras_armed_) return false;
  if (!trigger_.armed()) return true;
  arm_cameras();
  return false;
}

void CaptureNode::start() {
  take_->start();
  if (full_disks_) full_disks_->restart();
  trigger_.start();
}

void CaptureNode::drain() {
  trigger_.stop();
  take_->train_ended();
}

void CaptureNode::disarm() {
  trigger_.stop();
  cameras_.train_ended();
  if (counts_take()) close_take();
  take_.reset();
  cameras_.disarm();
  pulse_times_.end();
}

std::optional<CommandMessage> CaptureNode::rejoin() {
  // The node of the trigger made the pulses: with it, the train ended.
  if (trigger_.is_here()) return std::nullopt;
  const auto found = kept_orders_.running(*trigger_.watch());
  if (!found) return std::nullopt;
  begin_order(found->order, std::nullopt);
  const std::string& take = plan_.order.take;
  try {
    take_ = ActiveTake::go_on(of_this_node(), plan_, found->commanded);
  } catch (const std::exception&) {
    cameras_.disarm();
    const TakePaths paths = take_paths(studio_, take);
    if (!recorder_of(paths).empty()) throw;  // another process of this node's name has the order
    drop_command(studio_, node_, take);
    close_reopened_take(paths, node_);
    throw;
  }
  events_.send(Severity::kWarning, "take",
               node_ + " was started anew and records " + take + " again, from pulse " +
                   std::to_string(found->commanded) + " on",
               advice::kRejoined);
  return plan_.order;
}

ActiveTake::Node CaptureNode::of_this_node() {
  return {{studio_, node_, bus_, cameras_, places_, signer_ ? &*signer_ : nullptr},
          trigger_,
          [this](const PulseEdge& edge) { tell_cameras(edge); }};
}

void CaptureNode::tell_cameras(const PulseEdge& edge) {
  pulse_times_.add(edge.pulse, edge.at);
  cameras_.pulse_at(edge);
}

// --- what happens -------------------------------------------------------------------------------

std::optional<NodeReport> CaptureNode::poll(Phase phase) {
  for (const auto& camera : cameras_) camera_watch_.look_at(*camera);
  if (const auto edge = trigger_.unsensed_first_pulse()) tell_cameras(*edge);
  try {
    switch (phase) {
      case Phase::kArming:
        return poll_arming();
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

std::optional<NodeReport> CaptureNode::poll_arming() {
  if (is_arming_trigger()) return std::nullopt;
  const std::string waiting = cameras_.not_ready(plan_.order.allow_missing);
  const bool late = Monotonic::now() > ready_by_;
  if (!waiting.empty() && !late) return std::nullopt;
  if (!waiting.empty() && !checks()) {
    return NodeReport{.event = Input::kFailed, .text = "not ready: " + waiting, .detail = {}};
  }
  take_ = ActiveTake::begin(of_this_node(), plan_);
  std::string text = checks() ? "ready" : ready_text();
  if (!waiting.empty()) text = "without " + waiting;
  return NodeReport{.event = Input::kReady, .text = std::move(text), .detail = {}};
}

std::optional<NodeReport> CaptureNode::poll_learning() {
  const bool over = trigger_.train_is_over(plan_.order.take);
  if (over) take_->train_ended();
  // Other nodes learn of the pulses that are still to come.
  if (trigger_.is_here() && !over) return std::nullopt;
  const auto result = take_->learnt();
  if (!result) return std::nullopt;
  return NodeReport{
      .event = result->learnt ? Input::kReady : Input::kFailed, .text = result->text, .detail = {}};
}

std::optional<NodeReport> CaptureNode::poll_recording() {
  const std::string full = look_at_disks();
  if (!full.empty()) return NodeReport{.event = Input::kTrainEnded, .text = full, .detail = {}};
  if (!trigger_.train_is_over(plan_.order.take)) return std::nullopt;
  return NodeReport{.event = Input::kTrainEnded, .text = "pulses have ended", .detail = {}};
}

std::optional<NodeReport> CaptureNode::poll_draining() {
  trigger_.listen(plan_.order.take);
  if (!take_->is_accounted_for()) return std::nullopt;
  const TakeAccount account = close_take();
  if (checks()) return check_report(account);
  const bool kept = account.closing.unkept.empty();
  return NodeReport{.event = kept ? Input::kDrained : Input::kBroken,
                    .text = kept ? account.ledger.verdict() : account.closing.unkept,
                    .detail = ledger_json(account.ledger)};
}

TakeAccount CaptureNode::close_take() {
  TakeAccount account = std::exchange(take_, nullptr)->close();
  last_ = account.counts;
  if (!account.closing.notice.empty()) {
    events_.send(Severity::kInfo, "take", account.closing.notice, advice::kQuarantined);
  }
  if (!account.closing.unsigned_why.empty()) {
    events_.send(Severity::kWarning, "take", account.closing.unsigned_why, advice::kUnsigned);
  }
  if (!account.closing.lost_pulses.empty()) {
    events_.send(Severity::kWarning, "pulses", account.closing.lost_pulses, advice::kPulsesRefused);
  }
  return account;
}

NodeReport CaptureNode::check_report(const TakeAccount& account) const {
  std::vector<std::string> not_ready;
  for (const auto& camera : cameras_) {
    const bool seen = std::ranges::any_of(
        account.checked, [&](const CheckedCamera& c) { return c.pulses.name == camera->camera(); });
    if (!seen) not_ready.push_back(camera->camera());
  }
  return {.event = Input::kDrained,
          .text = "looked at " + std::to_string(account.checked.size()) + " cameras",
          .detail = check_json(account.ledger, account.checked, not_ready)};
}

// --- readiness ----------------------------------------------------------------------------------

double CaptureNode::bytes_per_second() const {
  return cameras_.bytes_per_pulse() * plan_.train.rate_hz;
}

std::string CaptureNode::look_at_disks() {
  NodeTake* const recording = take_->recording();
  if (recording == nullptr) return "";
  events_.keep_told(Severity::kAlarm, "queue", recording->queue_trouble(), advice::kQueue);
  const std::string here = recording->disk_must_end();
  disk_is_full_ = !here.empty();
  const std::string elsewhere = full_disks_ ? full_disks_->full_node() : "";
  if (here.empty() && elsewhere.empty()) return "";
  const std::string why = disk_is_full_ ? here : "the disk of " + elsewhere + " is full or broken";
  events_.send(Severity::kAlarm, "take", plan_.order.take + " was ended: " + why,
               advice::kTakeEnded);
  return why;
}

std::string CaptureNode::ready_text() const {
  constexpr double kFiveMinutes = 300;
  std::string text = std::to_string(cameras_.ready().size()) + " cameras streaming and quiet, " +
                     format_bytes(bytes_per_second() * kFiveMinutes) + " for 5 min, " +
                     format_bytes(disk_free_bytes(studio_)) + " free";
  if (!trigger_.is_here()) return text;
  return text + (trigger_.sensor() != nullptr ? ", trigger here" : ", trigger here, not sensed");
}

// --- health -------------------------------------------------------------------------------------

std::string CaptureNode::trouble() const {
  std::vector<std::string> lines;
  if (const std::string text = trigger_.fault(); !text.empty()) lines.push_back("trigger: " + text);
  if (const std::string text = trigger_.sensor_fault(); !text.empty()) {
    lines.push_back("sense line: " + text);
  }
  if (const std::string text = cameras_.trouble(); !text.empty()) lines.push_back(text);
  return fmt::format("{}", fmt::join(lines, "; "));
}

void CaptureNode::report_health(HealthMessage& health) {
  health.text = trouble();
  health.values["cameras"] = static_cast<double>(cameras_.size());
  health.values["disk_free_bytes"] = disk_free_bytes(studio_);
  if (const double bytes = bytes_per_second(); bytes > 0) {
    health.values["disk_seconds_left"] = disk_free_bytes(studio_) / bytes;
  }
  const TakeCounts counts = take_counts();
  report_take(counts, health);
  tell_troubles(counts);
  if (const auto pulses = trigger_.statistics()) {
    health.values["trigger_jitter_p50_us"] = 1e6 * to_seconds(pulses->jitter_p50);
    health.values["trigger_jitter_p99_us"] = 1e6 * to_seconds(pulses->jitter_p99);
    health.values["trigger_jitter_max_us"] = 1e6 * to_seconds(pulses->jitter_max);
    health.values["trigger_late"] = static_cast<double>(pulses->late);
  }
  health.values["frames_missing"] = 0;
  health.values["frames_suspect"] = 0;
  health.values["cameras_streaming"] = 0;
  health.values["queue_frames"] = 0;
  const int64_t due = counts_take() ? std::max<int64_t>(0, counts.commanded - kLatePeriods) : 0;
  for (const auto& camera : cameras_) camera_watch_.report(*camera, due, health);
}

void CaptureNode::report_take(const TakeCounts& counts, HealthMessage& health) const {
  const auto value = [&](const char* name, int64_t n) {
    health.values[name] = static_cast<double>(n);
  };
  value("frames_received", counts.frames.received);
  value("frames_written", counts.frames.written);
  value("frames_published", counts.frames.published);
  value("pulses_not_live", counts.pulses_not_live);
  value("write_errors", counts.frames.write_errors);
  value("pulses_lost", take_ ? take_->pulses().lost() : 0);
  value("pulses_commanded", counts.commanded);
  if (studio_.trigger.is_sensed()) value("pulses_sensed", counts.sensed);
  value(kDiskFull, disk_is_full_ ? 1 : 0);
  if (counts.frames.write_errors > 0) {
    health.text = "frames could not be written: the disk refuses";
  }
}

void CaptureNode::tell_troubles(const TakeCounts& counts) {
  if (take_ && take_->recording() != nullptr) {
    events_.keep_told(Severity::kAlarm, "disk", take_->recording()->disk_trouble(), advice::kDisk);
  }
  const bool senses = trigger_.sensor() != nullptr && counts_take();
  events_.keep_told(Severity::kAlarm, "trigger", trigger_trouble(counts), advice::kTrigger);
  events_.keep_told(Severity::kAlarm, "sense line", senses ? trigger_.sensor_fault() : "",
                    advice::kSenseLine);
  events_.keep_told(Severity::kWarning, "pulses", senses ? take_->pulses().trouble() : "",
                    advice::kPulses);
  events_.keep_told(Severity::kWarning, "live picture",
                    counts.pulses_not_live == 0
                        ? ""
                        : format_count(counts.pulses_not_live) +
                              " pulses not live: this machine is busy recording them",
                    advice::kLivePicture);
}

std::string CaptureNode::trigger_trouble(const TakeCounts& counts) const {
  if (const std::string fault = trigger_.fault(); !fault.empty()) return fault;
  const int64_t unseen = counts.commanded - kLatePeriods - counts.sensed;
  if (trigger_.sensor() == nullptr || !counts_take() || unseen <= 0) return "";
  return format_count(counts.commanded - counts.sensed) + " pulses commanded and not sensed";
}

bool CaptureNode::progressed_since(MonotonicInstant since) const {
  return !take_ || take_->progressed_since(since);
}

}  // namespace v3d
