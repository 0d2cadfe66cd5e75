#include "daemon/captured/node_devices.h"

#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/core/text.h"
#include "base/io/file.h"
#include "capture/cameras/camera.h"
#include "daemon/node/node_health.h"
#include "daemon/node/take_folder.h"
#include "trigger/pulse_generator.h"

namespace v3d::captured {
namespace {

/// A pulse may be sensed so many periods late.
constexpr int64_t kLatePulses = 5;
/// An estimated number of pulses is wrong by less than 1 in kClockToleranceDivisor.
constexpr int64_t kClockToleranceDivisor = 2000;

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

NodeCameras::NodeCameras(const Studio& studio, const std::string& node,
                         const capture::PulseTimes& pulses)
    : NodeCameras(studio, node, [&pulses](const StudioCamera& camera) {
        return capture::make_camera(camera, pulses);
      }) {}

NodeCameras::NodeCameras(const Studio& studio, const std::string& node, const MakeCamera& make)
    : studio_(studio) {
  for (const StudioCamera& camera : studio.cameras_of(node)) {
    workers_.push_back(std::make_unique<capture::CameraWorker>(
        camera.name, [make, camera] { return make(camera); },
        capture::CameraWorkerOptions{.queue_frames = kQueueFrames}));
  }
}

NodeCameras::~NodeCameras() {
  for (const auto& worker : workers_) worker->end();
}

void NodeCameras::arm(Duration period, bool edges_are_reported) {
  for (const auto& worker : workers_) worker->arm(period, edges_are_reported);
}

void NodeCameras::pulse_at(const capture::PulseEdge& edge) {
  for (const auto& worker : workers_) worker->pulse_at(edge);
}

void NodeCameras::train_ended() {
  for (const auto& worker : workers_) worker->train_ended();
}

void NodeCameras::disarm() {
  for (const auto& worker : workers_) worker->disarm();
}

std::vector<capture::CameraWorker*> NodeCameras::ready() const {
  std::vector<capture::CameraWorker*> ready;
  for (const auto& worker : workers_) {
    if (worker->status().state == capture::CameraState::kReady) ready.push_back(worker.get());
  }
  return ready;
}

bool NodeCameras::are_settling() const {
  return std::ranges::any_of(workers_, [](const auto& worker) {
    return worker->status().state == capture::CameraState::kSettling;
  });
}

std::string NodeCameras::not_ready(const std::vector<std::string>& may_be_missing) const {
  std::vector<std::string> cameras;
  for (const auto& worker : workers_) {
    const capture::CameraWorkerStatus status = worker->status();
    if (status.state == capture::CameraState::kReady || contains(may_be_missing, worker->camera()))
      continue;
    cameras.push_back(worker->camera() + " (" +
                      (status.text.empty() ? std::string(name(status.state)) : status.text) + ")");
  }
  return fmt::format("{}", fmt::join(cameras, ", "));
}

std::string NodeCameras::clock_fault() const {
  std::vector<std::string> unlocked;
  for (const capture::CameraWorker* worker : ready()) {
    const bool is_triggered = std::ranges::any_of(
        studio_.trigger.action.cameras,
        [&](const ActionCamera& camera) { return camera.name == worker->camera(); });
    if (is_triggered && !worker->status().link.ptp_locked) unlocked.push_back(worker->camera());
  }
  if (unlocked.empty()) return {};
  return fmt::format("PTP is not locked on {}", fmt::join(unlocked, ", "));
}

void NodeCameras::check_prepared(const std::vector<std::string>& may_be_missing) const {
  if (!file_exists(studio_.storage.calib)) {
    throw InputError(studio_.storage.calib.string() +
                     ": does not exist; v3dctl calibrate guess makes a first one");
  }
  const Rig rig = load_calib(studio_.storage.calib);
  for (const auto& worker : workers_) {
    const std::string& camera = worker->camera();
    if (find_camera(rig, camera) < 0) {
      throw InputError(studio_.storage.calib.string() + ": has no camera '" + camera + "' of " +
                       studio_.path.string() + "; calibrate the camera");
    }
    if (!segmentation::has_background(studio_.storage.background, camera) &&
        !contains(may_be_missing, camera)) {
      throw InputError(camera + " has no background model in " +
                       studio_.storage.background.string() +
                       "; clear the studio and run v3dctl background");
    }
  }
}

segmentation::BackgroundModel NodeCameras::background_of(
    const capture::CameraWorker& worker) const {
  segmentation::BackgroundModel model =
      segmentation::load_background(studio_.storage.background, worker.camera());
  const capture::CameraWorkerStatus status = worker.status();
  if (status.size != model.size || reduced_to_8_bits(status.format) != model.format) {
    throw InputError(worker.camera() +
                     ": its background model has another image size or pixel format; "
                     "run v3dctl background");
  }
  return model;
}

std::vector<NodeCameras::RecordedCamera> NodeCameras::recorded(
    const std::vector<std::string>& may_be_missing) const {
  std::vector<RecordedCamera> recorded;
  for (capture::CameraWorker* worker : ready()) {
    try {
      recorded.push_back({worker, background_of(*worker)});
    } catch (const InputError& error) {
      if (!contains(may_be_missing, worker->camera())) throw;
      spdlog::warn("without {}: {}", worker->camera(), error.what());
    }
  }
  return recorded;
}

double NodeCameras::bytes_per_pulse() const {
  double bytes = 0;
  for (const auto& worker : workers_) {
    const capture::CameraWorkerStatus status = worker->status();
    bytes += static_cast<double>(byte_count(status.size, status.format));
  }
  return bytes;
}

int64_t NodeCameras::max_queued() const {
  int64_t longest = 0;
  for (const auto& worker : workers_) longest = std::max(longest, worker->waiting());
  return longest;
}

int64_t NodeCameras::dropped() const {
  int64_t sum = 0;
  for (const auto& worker : workers_) sum += worker->status().dropped;
  return sum;
}

std::string NodeCameras::fault_text() const {
  std::vector<std::string> lines;
  for (const auto& worker : workers_) {
    const std::string text = worker->status().text;
    if (!text.empty()) lines.push_back(worker->camera() + ": " + text);
  }
  return node::join_camera_problems(lines);
}

NodeTrigger::NodeTrigger(const Studio& studio, const std::string& node, bus::Bus& bus)
    : is_sensed_(studio.trigger.is_sensed()) {
  if (studio.trigger.node == node) {
    generator_ = trigger::make_generator(studio.trigger);
    sensor_ = trigger::make_sensor(studio.trigger, *generator_);
  } else {
    monitor_ = std::make_unique<node::TrainMonitor>(bus, studio.trigger.node);
  }
}

NodeTrigger::NodeTrigger(std::unique_ptr<trigger::PulseGenerator> generator,
                         std::unique_ptr<trigger::PulseSensor> sensor)
    : is_sensed_(sensor != nullptr), generator_(std::move(generator)), sensor_(std::move(sensor)) {}

void NodeTrigger::arm(const trigger::PulseTrain& train) {
  if (monitor_) monitor_->reset();
  if (!generator_) return;
  period_ = period_of(train.rate_hz);
  generator_->stop();
  generator_->arm(train);
}

void NodeTrigger::set_clock_fault(const std::string& fault) {
  if (generator_) generator_->set_clock_fault(fault);
}

void NodeTrigger::start() {
  first_pulse_reported_ = false;
  next_unsensed_ = 1;
  if (monitor_) monitor_->reset();
  if (generator_) generator_->start();
}

void NodeTrigger::stop() {
  if (generator_) generator_->stop();
}

std::optional<capture::PulseEdge> NodeTrigger::unsensed_first_pulse() {
  if (first_pulse_reported_ || sensor_ || !generator_) return std::nullopt;
  const auto first = generator_->first_pulse();
  if (!first) return std::nullopt;
  first_pulse_reported_ = true;
  return capture::PulseEdge{
      .pulse = 0, .at = *first, .may_be_early = !generator_->is_paced_by_this_host()};
}

std::vector<capture::PulseEdge> NodeTrigger::unsensed_pulses() {
  std::vector<capture::PulseEdge> pulses;
  if (sensor_ || !generator_ || !generator_->is_paced_by_this_host()) return pulses;
  const auto first = generator_->first_pulse();
  if (!first || !first_pulse_reported_) return pulses;
  const int64_t end = generator_->commanded();
  for (; next_unsensed_ < end; ++next_unsensed_) {
    pulses.push_back({.pulse = next_unsensed_, .at = *first + next_unsensed_ * period_});
  }
  return pulses;
}

void NodeTrigger::poll(const std::string& take) {
  if (monitor_) monitor_->poll(take);
}

bool NodeTrigger::train_has_ended(const std::string& take) {
  poll(take);
  return generator_ ? generator_->finished() : monitor_->ended();
}

bool NodeTrigger::sensor_count_is_better() const {
  return generator_ && sensor_ && !generator_->counts_exactly();
}

int64_t NodeTrigger::commanded(int64_t seen) const {
  if (sensor_count_is_better()) {
    const bool is_sensed = unsensed_warning(seen).empty();  // else the sense line is broken
    return is_sensed ? seen : generator_->commanded();
  }
  // On other nodes: the messages of the last pulses may have been lost.
  return generator_ ? generator_->commanded() : std::max(seen, monitor_->commanded());
}

std::vector<std::string> NodeTrigger::problems(bool in_train) const {
  std::vector<std::string> lines;
  const std::string of_generator = fault(), of_cameras = warning(), of_sensor = sensor_fault();
  if (in_train ? !of_generator.empty() : of_generator.starts_with(trigger::kPulsesMayContinue)) {
    lines.push_back("trigger: " + of_generator);
  }
  if (in_train && !of_cameras.empty()) lines.push_back(of_cameras);
  if (in_train && !of_sensor.empty()) lines.push_back("sense line: " + of_sensor);
  return lines;
}

std::string NodeTrigger::unsensed_warning(int64_t sensed) const {
  if (!generator_ || !sensor_) return "";
  const bool is_estimate = sensor_count_is_better();
  const int64_t due = generator_->commanded();
  const int64_t margin = kLatePulses + (is_estimate ? due / kClockToleranceDivisor : 0);
  if (due - margin <= sensed) return "";
  return (is_estimate ? "about " : "") + format_count(due - sensed) +
         " pulses commanded but not sensed";
}

void NodeTrigger::report(wire::HealthMessage& health) const {
  if (!generator_) return;
  const trigger::PulseStatistics pulses = generator_->statistics();
  health.values["trigger_jitter_p50_us"] = 1e6 * to_seconds(pulses.jitter_p50);
  health.values["trigger_jitter_p99_us"] = 1e6 * to_seconds(pulses.jitter_p99);
  health.values["trigger_jitter_max_us"] = 1e6 * to_seconds(pulses.jitter_max);
  health.values["trigger_late"] = static_cast<double>(pulses.late);
  const auto add = [&](const char* name, std::optional<int64_t> count) {
    if (count) health.values[name] = static_cast<double>(*count);
  };
  add("trigger_acks_missing", pulses.acks_missing);
  add("trigger_acks_rejected", pulses.acks_rejected);
}

}  // namespace v3d::captured
