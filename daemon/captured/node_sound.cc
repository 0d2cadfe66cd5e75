#include "daemon/captured/node_sound.h"

#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>

#include "base/core/error.h"
#include "base/core/text.h"
#include "daemon/node/advice.h"
#include "trigger/simulated_trigger.h"

namespace v3d::captured {
namespace {

constexpr Duration kReadTimeout = std::chrono::milliseconds(200);
constexpr Duration kReopenAfter = std::chrono::seconds(1);
/// A device delivers a block every 10 ms. One that delivers none for this long, in so many reads,
/// has failed. The reads count, too: a process that was stopped has time pass without a read.
constexpr Duration kMaxSilence = std::chrono::seconds(2);
constexpr int kMaxEmptyReads = kMaxSilence / kReadTimeout;
constexpr size_t kQueueBlocks = 1000;  // 10 s
/// Longest wait for the last samples of a take.
constexpr Duration kMaxTail = std::chrono::milliseconds(500);
constexpr double kFullScale = 2147483648.0;

/// The edges on the simulated trigger cable. Connects when a server listens.
class SimulatedPulses {
 public:
  explicit SimulatedPulses(std::filesystem::path wire) : path_(std::move(wire)) {}

  std::vector<MonotonicInstant> operator()() {
    std::vector<MonotonicInstant> pulses;
    if (path_.empty() || !connect()) return pulses;
    while (const auto edge = cable_->receive(MonotonicInstant())) {
      pulses.push_back(from_ns<Monotonic>(edge->edge_monotonic_ns));
    }
    return pulses;
  }

 private:
  bool connect() {
    if (cable_ && !cable_->disconnected()) return true;
    try {
      cable_ = std::make_shared<trigger::TriggerCableClient>(path_);
    } catch (const InputError&) {
      cable_ = nullptr;
    }
    return cable_ != nullptr;
  }

  const std::filesystem::path path_;
  std::shared_ptr<trigger::TriggerCableClient> cable_;
};

}  // namespace

NodeSound::NodeSound(const StudioSound& sound, std::filesystem::path wire, TimecodeSource timecode)
    : sound_(sound),
      wire_(std::move(wire)),
      timecode_(std::move(timecode)),
      levels_(sound),
      thread_([this] { run(); }) {}

NodeSound::~NodeSound() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void NodeSound::begin(const take::TakePaths& paths, const std::string& take, double pulse_rate_hz) {
  auto queue = std::make_shared<SoundQueue>(kQueueBlocks);
  const std::lock_guard lock(mutex_);
  auto started =
      std::make_shared<SoundTake>(SoundTake::Setup{.sound = sound_,
                                                   .paths = paths,
                                                   .take = take,
                                                   .pulse_rate_hz = pulse_rate_hz,
                                                   .stamp_uncertainty_s = stamp_uncertainty_s_,
                                                   .timecode = timecode_,
                                                   .position = delivered_},
                                  queue);
  queue_ = std::move(queue);
  take_ = std::move(started);
}

std::optional<take::SoundLedger> NodeSound::end() {
  std::shared_ptr<SoundTake> ended;
  {
    std::unique_lock lock(mutex_);
    if (!take_) return std::nullopt;
    end_queue(lock);
    ended = std::exchange(take_, nullptr);
  }
  auto ledger = ended->close();
  const std::lock_guard lock(mutex_);
  last_take_ = ended->counts();
  return ledger;
}

void NodeSound::begin_check(double pulse_rate_hz) {
  auto queue = std::make_shared<SoundQueue>(kQueueBlocks);
  auto started = std::make_shared<SoundCheck>(
      sound::SoundTrack::Setup{.sound = sound_,
                               .pulse_rate_hz = pulse_rate_hz,
                               .stamp_uncertainty_s = stamp_uncertainty_s_},
      queue);
  const std::lock_guard lock(mutex_);
  queue_ = std::move(queue);
  check_ = std::move(started);
}

CheckedSound NodeSound::end_check() {
  std::shared_ptr<SoundCheck> ended;
  std::string fault;
  {
    std::unique_lock lock(mutex_);
    end_queue(lock);
    ended = std::exchange(check_, nullptr);
    fault = fault_;
  }
  CheckedSound checked = ended->close();
  if (!fault.empty()) checked.fault = fault;
  return checked;
}

void NodeSound::end_queue(std::unique_lock<std::mutex>& lock) {
  const MonotonicInstant now = Monotonic::now();
  changed_.wait_for(lock, kMaxTail, [&] { return !is_open_ || delivered_until_ >= now; });
  queue_ = nullptr;
}

void NodeSound::pulse_at(const capture::PulseEdge& edge) {
  const std::lock_guard lock(mutex_);
  if (take_) take_->pulse_at(edge);
  if (check_) check_->pulse_at(edge);
}

NodeSound::Status NodeSound::status() {
  const std::lock_guard lock(mutex_);
  Status status{.is_open = is_open_, .fault = fault_};
  status.peaks = std::exchange(peaks_, {});
  if (is_open_) status.level_faults = levels_.faults();
  status.take = take_ ? take_->counts() : last_take_;
  if (take_) {
    status.waiting_s = static_cast<double>(delivered_ - status.take.position) / sound_.rate_hz;
  }
  return status;
}

void NodeSound::run() {
  for (;;) {
    auto input = sound::open_sound_input(sound_, SimulatedPulses(wire_));
    if (input) {
      stamp_uncertainty_s_ = (*input)->stamp_uncertainty_s();
      read_device(**input);
    } else {
      set_fault(input.error().message);
    }
    if (!wait(kReopenAfter)) return;
  }
}

/// Reads until an error, or until the thread has to end. The device counts as open from its first
/// samples on.
void NodeSound::read_device(sound::SoundInput& input) {
  const int64_t first_position = position_, first_xrun = xruns_;
  bool has_delivered = false;
  MonotonicInstant last_block = Monotonic::now();
  int empty_reads = 0;
  while (wait(Duration(0))) {
    auto block = input.read(kReadTimeout);
    if (!block) {
      ++xruns_;  // samples are lost until the device is open again
      return set_fault(block.error().message);
    }
    if (!*block) {
      if (++empty_reads < kMaxEmptyReads || Monotonic::now() - last_block < kMaxSilence) continue;
      ++xruns_;
      return set_fault(sound_.device + " delivers no samples, and no error");
    }
    last_block = Monotonic::now();
    empty_reads = 0;
    if (!std::exchange(has_delivered, true)) set_fault("");
    (*block)->position += first_position;
    (*block)->xruns += first_xrun;
    xruns_ = (*block)->xruns;
    position_ = (*block)->position + std::ssize((*block)->values) / sound_.channels;
    deliver(*std::move(*block));
  }
}

void NodeSound::deliver(sound::SoundBlock block) {
  std::vector<double> peaks(static_cast<size_t>(sound_.channels));
  for (size_t i = 0; i < block.values.size(); ++i) {
    double& peak = peaks[i % peaks.size()];
    peak = std::max(peak, std::abs(block.values[i] / kFullScale));
  }
  const std::lock_guard lock(mutex_);
  peaks_.resize(peaks.size());
  for (size_t i = 0; i < peaks.size(); ++i) peaks_[i] = std::max(peaks_[i], peaks[i]);
  levels_.add(peaks, std::ssize(block.values) / sound_.channels);
  delivered_until_ = block.at;
  delivered_ = block.position + std::ssize(block.values) / sound_.channels;
  if (queue_) queue_->push(std::move(block));
  changed_.notify_all();
}

void NodeSound::set_fault(const std::string& fault) {
  const std::lock_guard lock(mutex_);
  fault_ = fault;
  is_open_ = fault.empty();
  levels_.reset();
}

bool NodeSound::wait(Duration duration) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, duration, [&] { return stopping_; });
  return !stopping_;
}

namespace {

using sound::LevelFault;
using sound::LevelMonitor;

/// Sound that waits for the disk longer than this, seconds, is reported: a kill loses it.
constexpr double kMaxWaiting = 1;

/// A subject for each channel, because the limit on repeated events compares the text of one.
void report_levels(const NodeSound::Status& status, wire::HealthMessage& health,
                   bus::EventSender& events) {
  const auto count = [&](LevelFault fault) {
    return static_cast<double>(
        std::ranges::count(status.level_faults, fault, &sound::ChannelFault::fault));
  };
  health.values["sound_channels_clipping"] = count(LevelFault::kClips);
  health.values["sound_channels_silent"] = count(LevelFault::kSilent);
  for (size_t channel = 1; channel <= status.peaks.size(); ++channel) {
    const auto found = std::ranges::find(status.level_faults, static_cast<int>(channel),
                                         &sound::ChannelFault::channel);
    const bool clips = found != status.level_faults.end() && found->fault == LevelFault::kClips;
    const std::string text =
        found == status.level_faults.end() ? ""
        : clips ? fmt::format("clips, with peaks of {:g} dBFS or more", LevelMonitor::kClippingDbfs)
                : fmt::format("is silent: no peak of {:g} dBFS for {:g} s",
                              LevelMonitor::kSilenceDbfs, LevelMonitor::kHoldSeconds);
    events.report_condition(wire::Severity::kWarning, "sound channel " + std::to_string(channel),
                            text, clips ? node::advice::kSoundClips : node::advice::kSoundSilent);
  }
}

void report_jumps(const SoundTake::Counts& take, wire::HealthMessage& health,
                  bus::EventSender& events) {
  health.values["sound_timecode_jumps"] = static_cast<double>(take.timecode_jumps);
  const std::string text =
      take.timecode_jumps == 0
          ? ""
          : format_count(take.timecode_jumps) +
                (take.timecode_jumps == 1 ? " jump of the timecode: "
                                          : " jumps of the timecode, the first: ") +
                take.first_jump;
  events.report_condition(wire::Severity::kWarning, "sound timecode", text,
                          node::advice::kTimecodeJumps);
}

}  // namespace

void report_sound(const NodeSound::Status& status, wire::HealthMessage& health,
                  bus::EventSender& events) {
  health.values["sound_open_flag"] = status.is_open ? 1 : 0;
  health.values["sound_samples"] = static_cast<double>(status.take.samples);
  health.values["sound_xruns"] = static_cast<double>(status.take.xruns);
  for (size_t i = 0; i < status.peaks.size(); ++i) {
    health.values["sound_peak_" + std::to_string(i + 1) + "_db"] =
        sound::decibels_of(status.peaks[i]);
  }
  const auto report = [&](const char* subject, const std::string& text, const char* advice) {
    events.report_condition(wire::Severity::kWarning, subject, text, advice);
  };
  report("sound", status.fault, node::advice::kSound);
  report("sound file", status.take.error, node::advice::kSoundFile);
  report("sound disk",
         status.waiting_s <= kMaxWaiting
             ? ""
             : fmt::format("{:.0f} s of sound wait for the disk", status.waiting_s),
         node::advice::kSoundDisk);
  const int64_t xruns = status.take.xruns;
  report("sound xruns", xruns == 0 ? "" : format_count(xruns) + " xruns: samples of sound are lost",
         node::advice::kSoundXruns);
  report_jumps(status.take, health, events);
  report_levels(status, health, events);
}

void report_timecode_output(const TimecodeOutput::Status& status, wire::HealthMessage& health,
                            bus::EventSender& events) {
  health.values["timecode_output_open_flag"] = status.is_open ? 1 : 0;
  health.values["timecode_output_underruns"] = static_cast<double>(status.underruns);
  const auto report = [&](const char* subject, const std::string& text, const char* advice) {
    events.report_condition(wire::Severity::kWarning, subject, text, advice);
  };
  report("timecode output", status.fault, node::advice::kTimecodeOutput);
  report("timecode output underruns",
         status.underruns == 0
             ? ""
             : format_count(status.underruns) + " underruns: the timecode was interrupted",
         node::advice::kTimecodeUnderruns);
}

}  // namespace v3d::captured
