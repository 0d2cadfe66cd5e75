#include "simulation/simulated_work.h"

#include <algorithm>

#include "base/core/error.h"
#include "daemon/control/reply_json.h"
#include "daemon/control/take_name.h"
#include "daemon/node/node_health.h"
#include "daemon/node/peer_health.h"
#include "daemon/node/take_folder.h"

namespace v3d::simulation {
namespace {

// The same limits as in CaptureNode, ActiveTake and ReconNode.
constexpr Duration kReadyWithin = std::chrono::seconds(15);
constexpr Duration kDrainWithin = std::chrono::seconds(15);
constexpr Duration kMaxQuiet = std::chrono::seconds(1);
constexpr Duration kEndReportedWithin = std::chrono::milliseconds(1500);
constexpr Duration kPlatesWithin = std::chrono::seconds(15);
constexpr Duration kReconQuiet = std::chrono::milliseconds(1200);

}  // namespace

// --- common to both kinds -----------------------------------------------------------------------

std::optional<node::RejoinDecision::Found> SimulatedWork::running_take() {
  if (!rejoin_.is_open()) return std::nullopt;
  std::optional<node::TrainState::RunningTake> running;
  for (const node::ReceivedHealth& health : std::exchange(trigger_health_, {})) {
    if (auto update = train_.running(health)) running = std::move(update);
  }
  return running ? rejoin_.decide(*running) : std::nullopt;
}

void SimulatedWork::listen_to_train() {
  for (const node::ReceivedHealth& health : std::exchange(trigger_health_, {})) {
    train_.on_health(health, order_.take);
  }
}

/// Forgets the earlier train, as TrainMonitor::reset() does.
void SimulatedWork::restart_train() {
  for (const node::ReceivedHealth& health : std::exchange(trigger_health_, {})) train_.note(health);
  train_.reset(now());
}

void SimulatedWork::clear_persisted_orders() {
  host_.disk.clear_orders();
  rejoin_.close();
}

void SimulatedWork::create_take(const std::vector<std::string>& cameras) {
  TakeOnDisk& take = host_.disk.takes[order_.take];
  take = {};
  take.cameras = cameras;
  take.persisted_order = order_;
}

void SimulatedWork::remove_take() {
  const auto take = host_.disk.takes.find(order_.take);
  if (take == host_.disk.takes.end()) return;
  world_.truth.on_removed(host_.name, order_.take, take->second);
  host_.disk.takes.erase(take);
}

void SimulatedWork::reject_existing(const wire::CommandMessage& order) const {
  control::check_take_name(order.take);
  if (!host_.disk.takes.contains(order.take)) return;
  throw InputError("take " + order.take + " exists already; choose another name");
}

// --- capture ------------------------------------------------------------------------------------

void SimulatedCapture::arm(const wire::CommandMessage& order) {
  if (order.verb == wire::CommandVerb::kArm) reject_existing(order);
  make_ready(order);
}

void SimulatedCapture::make_ready(const wire::CommandMessage& order) {
  clear_persisted_orders();
  order_ = order;
  disk_is_full_ = ended_by_disk_ = false;
  restart_train();
  if (host_.trigger != nullptr) host_.trigger->arm(order, world_.rate_hz, train_length());
  is_ready_ = !world_.draws.chance(host_.not_ready);
  ready_at_ = now() + (is_ready_ ? world_.draws.seconds(0.01, 0.8) : kReadyWithin);
}

std::optional<int64_t> SimulatedCapture::train_length() const {
  return order_.pulses > 0 ? std::optional(order_.pulses) : std::nullopt;
}

control::NodeReport SimulatedCapture::poll_arming() {
  if (now() < ready_at_) return {.event = control::Input::kFailed, .text = "", .detail = {}};
  if (!is_ready_) return {.event = control::Input::kFailed, .text = "not ready: cam", .detail = {}};
  if (order_.verb == wire::CommandVerb::kArm && host_.disk.is_full) {
    return {.event = control::Input::kFailed, .text = "needs 29 GB, 1 GB free", .detail = {}};
  }
  open_take();
  return {.event = control::Input::kReady, .text = "ready", .detail = {}};
}

void SimulatedCapture::open_take() {
  is_open_ = true;
  was_started_ = false;
  pulses_ = captured::KnownPulses(order_.take, now());
  accounts_.clear();
  received_.clear();
  write_errors_ = 0;
  if (!records()) return;
  create_take(host_.cameras);
}

void SimulatedCapture::start() {
  was_started_ = true;
  restart_train();
  for (auto& [node, disk] : other_disks_) disk.reset(now());
  learn_by_ =
      now() + from_seconds(static_cast<double>(order_.pulses + 2) / world_.rate_hz) + kPlatesWithin;
  if (host_.trigger == nullptr) return;
  if (world_.draws.chance(host_.not_ready)) throw InputError("the trigger does not answer");
  host_.trigger->start();
}

void SimulatedCapture::drain() {
  if (host_.trigger != nullptr) host_.trigger->stop();
  ended_ = now();
}

void SimulatedCapture::disarm() {
  if (host_.trigger != nullptr) host_.trigger->stop();
  if (is_counted()) close_take();
  is_open_ = false;
}

std::optional<wire::CommandMessage> SimulatedCapture::rejoin() {
  if (host_.trigger != nullptr) return std::nullopt;
  const auto found = running_take();
  if (!found) return std::nullopt;
  order_ = found->command;
  TakeOnDisk& take = on_disk();
  pulses_ = captured::KnownPulses(order_.take, take.pulses, found->commanded, now());
  accounts_.clear();
  for (const auto& [camera, frames] : take.frames) {
    for (const int64_t pulse : frames) accounts_[camera].add(pulse, false);
    received_[camera] = std::ssize(frames);
  }
  take.is_open = is_open_ = was_started_ = true;
  disk_is_full_ = false;
  write_errors_ = 0;
  return order_;
}

std::optional<control::NodeReport> SimulatedCapture::poll(control::Phase phase) {
  switch (phase) {
    case control::Phase::kArming: {
      control::NodeReport report = poll_arming();
      if (report.text.empty()) return std::nullopt;
      return report;
    }
    case control::Phase::kLearning:
      return poll_learning();
    case control::Phase::kRecording:
      return poll_recording();
    case control::Phase::kDraining:
      return poll_draining();
    default:
      return std::nullopt;
  }
}

bool SimulatedCapture::train_has_ended() {
  listen_to_train();
  return host_.trigger != nullptr ? host_.trigger->is_finished() : train_.ended();
}

std::optional<control::NodeReport> SimulatedCapture::poll_learning() {
  const bool over = train_has_ended();
  if (host_.trigger != nullptr && !over) return std::nullopt;
  const bool learnt = std::ranges::all_of(
      host_.cameras, [&](const std::string& camera) { return received_[camera] >= order_.pulses; });
  if (!learnt && now() < learn_by_) return std::nullopt;
  return control::NodeReport{.event = learnt ? control::Input::kReady : control::Input::kFailed,
                             .text = learnt ? "learnt the background" : "only some plates arrived",
                             .detail = {}};
}

std::optional<control::NodeReport> SimulatedCapture::poll_recording() {
  disk_is_full_ = records() && (write_errors_ > 0 || host_.disk.is_full);
  ended_by_disk_ = disk_is_full_ || std::ranges::any_of(other_disks_, [](const auto& disk) {
                     return disk.second.is_full();
                   });
  if (ended_by_disk_) {
    return control::NodeReport{
        .event = control::Input::kTrainEnded, .text = "a disk is full", .detail = {}};
  }
  if (!train_has_ended()) return std::nullopt;
  return control::NodeReport{
      .event = control::Input::kTrainEnded, .text = "pulses have ended", .detail = {}};
}

int64_t SimulatedCapture::commanded() const {
  return host_.trigger != nullptr ? host_.trigger->commanded()
                                  : std::max(pulses_.seen(), train_.commanded());
}

bool SimulatedCapture::is_drained() const {
  const Duration since = now() - ended_;
  if (since >= kDrainWithin) return true;
  const Duration quiet = std::min<Duration>(kMaxQuiet, 10 * period_of(world_.rate_hz));
  const bool silent = since > quiet;
  const bool pulses_known = host_.trigger != nullptr
                                ? silent || pulses_.count() >= commanded()
                                : silent && (train_.ended() || since > kEndReportedWithin);
  return pulses_known && has_all(commanded(), silent, quiet);
}

bool SimulatedCapture::has_all(int64_t pulses, bool silent, Duration quiet) const {
  if (silent && last_frame_ < now() - quiet) return true;
  return std::ranges::all_of(host_.cameras, [&](const std::string& camera) {
    const auto received = received_.find(camera);
    return (received == received_.end() ? 0 : received->second) >= pulses;
  });
}

std::optional<control::NodeReport> SimulatedCapture::poll_draining() {
  listen_to_train();
  if (!is_drained()) return std::nullopt;
  const take::Ledger ledger = close_take();
  if (order_.verb == wire::CommandVerb::kCheck) {
    return control::NodeReport{
        .event = control::Input::kDrained, .text = "checked cameras", .detail = {}};
  }
  const auto take = host_.disk.takes.find(order_.take);
  if (take != host_.disk.takes.end() && take->second.is_open) {
    return control::NodeReport{.event = control::Input::kBroken,
                               .text = "cannot write the ledger",
                               .detail = control::ledger_detail(ledger)};
  }
  return control::NodeReport{.event = control::Input::kDrained,
                             .text = ledger.verdict(),
                             .detail = control::ledger_detail(ledger)};
}

take::Ledger SimulatedCapture::close_take() {
  take::Ledger ledger;
  ledger.take = order_.take;
  ledger.commanded = commanded();
  ledger.commanded_is_minimum =
      host_.trigger == nullptr && !train_.ended() && train_length() != ledger.commanded;
  const bool knows = captured::sensed_count_is_known(
      world_.has_sense_line, host_.trigger != nullptr, pulses_.count(), ledger.commanded);
  if (knows) pulses_.fill_ledger(ledger, ledger.commanded);
  is_open_ = false;
  if (order_.verb != wire::CommandVerb::kArm) return ledger;
  for (const std::string& camera : host_.cameras) {
    ledger.cameras.push_back(accounts_[camera].ledger(camera, ledger.commanded));
  }
  if (host_.disk.loses_ledgers) {
    // A recovery finds the frames, but not the exact number of pulses.
    if (host_.trigger != nullptr) world_.truth.on_trigger_lost();
    return ledger;
  }
  on_disk().ledger = ledger;
  on_disk().is_open = false;
  if (captured::is_empty_take(ledger, was_started_, host_.trigger != nullptr)) remove_take();
  return ledger;
}

void SimulatedCapture::report_health(wire::HealthMessage& health) {
  const bool counts = is_counted();
  health.values["pulses_commanded"] = static_cast<double>(counts ? commanded() : 0);
  health.values[node::kDiskFull] = disk_is_full_ ? 1 : 0;
}

void SimulatedCapture::on_other_health(const node::ReceivedHealth& message) {
  if (host_.trigger == nullptr) return;
  node::FullDiskState& disk = other_disks_[message.health.node];
  if (was_started_) {
    disk.on_health(message, order_.take);
  } else {
    disk.note(message);
  }
}

void SimulatedCapture::on_pulse_message(const wire::PulseMessage& pulse) {
  if (is_open_ && host_.trigger == nullptr && pulses_.accepts(pulse, now())) {
    pulses_.add(pulse.pulse, now());
    if (records()) on_disk().pulses.insert(pulse.pulse);
  }
}

void SimulatedCapture::on_sensed(int64_t pulse) {
  if (!is_open_) return;
  pulses_.add(pulse, now());
  if (records()) on_disk().pulses.insert(pulse);
}

void SimulatedCapture::on_frame(const std::string& camera, int64_t pulse) {
  if (!is_open_) return;
  last_frame_ = now();
  ++received_[camera];
  if (records()) write(camera, pulse);
}

void SimulatedCapture::write(const std::string& camera, int64_t pulse) {
  if (host_.disk.is_full) {
    ++write_errors_;
    return;
  }
  on_disk().frames[camera].push_back(pulse);
  accounts_[camera].add(pulse, false);
  world_.truth.on_frame_written(host_.name, order_.take, order_id(order_), camera, pulse);
}

// --- reconstruction -----------------------------------------------------------------------------

void SimulatedRecon::arm(const wire::CommandMessage& order) {
  clear_persisted_orders();
  order_ = order;
  ready_at_ = now() + world_.draws.seconds(0.01, 2);
  if (order.verb == wire::CommandVerb::kCheck) return;
  reject_existing(order);
  create_take({});
  is_open_ = true;
}

void SimulatedRecon::learn(const wire::CommandMessage& order) {
  clear_persisted_orders();
  order_ = order;
  ready_at_ = now();
}

void SimulatedRecon::disarm() {
  if (!std::exchange(is_open_, false)) return;
  if (on_disk().meshes == 0) remove_take();
}

std::optional<wire::CommandMessage> SimulatedRecon::rejoin() {
  const auto found = running_take();
  if (!found) return std::nullopt;
  order_ = found->command;
  is_open_ = true;
  return order_;
}

std::optional<control::NodeReport> SimulatedRecon::poll(control::Phase phase) {
  const auto report = [](control::Input event, const char* text) {
    return control::NodeReport{.event = event, .text = text, .detail = {}};
  };
  switch (phase) {
    case control::Phase::kArming:
      if (now() < ready_at_) return std::nullopt;
      return report(control::Input::kReady, "reconstructs at 10 mm");
    case control::Phase::kLearning:
      return report(control::Input::kReady, "nothing to learn here");
    case control::Phase::kRecording:
      listen_to_train();
      if (!train_.ended()) return std::nullopt;
      return report(control::Input::kTrainEnded, "pulses have ended");
    case control::Phase::kDraining:
      if (is_open_ && now() - drain_began_ <= kReconQuiet) return std::nullopt;
      return report(control::Input::kDrained, "meshes");
    default:
      return std::nullopt;
  }
}

void SimulatedRecon::on_frame(const std::string&, int64_t) {
  if (is_open_) ++on_disk().meshes;
}

}  // namespace v3d::simulation
