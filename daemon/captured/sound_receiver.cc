#include "daemon/captured/sound_receiver.h"

#include <algorithm>
#include <span>
#include <utility>

namespace v3d::captured {
namespace {

constexpr Duration kPollInterval = std::chrono::milliseconds(50);
constexpr size_t kMaxPulses = 4096;

}  // namespace

SoundReceiver::SoundReceiver(std::shared_ptr<SoundQueue> queue, OnBlock on_block)
    : queue_(std::move(queue)), on_block_(std::move(on_block)), thread_([this] { run(); }) {}

SoundReceiver::~SoundReceiver() { stop(); }

void SoundReceiver::stop() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void SoundReceiver::pulse_at(const capture::PulseEdge& edge) {
  const std::lock_guard lock(mutex_);
  pulses_.push_back(edge);
  if (pulses_.size() > kMaxPulses) pulses_.pop_front();
}

std::deque<capture::PulseEdge> SoundReceiver::pop_pulses() {
  const std::lock_guard lock(mutex_);
  return std::exchange(pulses_, {});
}

void SoundReceiver::run() {
  for (;;) {
    const bool is_last_iteration = stopping_;
    const auto block =
        queue_->pop(is_last_iteration ? Monotonic::now() : Monotonic::now() + kPollInterval);
    if (block) on_block_(*block);
    if (!block && is_last_iteration) return;
  }
}

SoundCheck::SoundCheck(const sound::SoundTrack::Setup& setup, std::shared_ptr<SoundQueue> queue)
    : input_(setup.sound),
      audible_(sound::audible_channels(setup.sound)),
      track_(setup),
      finder_(setup.sound.rate_hz),
      receiver_(std::move(queue), [this](const sound::SoundBlock& block) { process(block); }) {}

void SoundCheck::take_pulses() {
  for (const capture::PulseEdge& pulse : receiver_.pop_pulses()) {
    track_.add_pulse(pulse.pulse, pulse.at);
    if (!first_pulse_) first_pulse_ = pulse.at;
  }
}

void SoundCheck::process(const sound::SoundBlock& block) {
  take_pulses();
  const int64_t before = track_.samples();
  const int64_t silence = track_.add(block);
  if (!first_pulse_ || block.at < *first_pulse_) return;
  if (!searched_from_) searched_from_ = before;
  if (silence > 0) search_silence(silence);
  std::vector<float> mono(block.values.size() / static_cast<size_t>(input_.channels));
  for (const int number : audible_) {
    const auto channel = sound::channel_of(block.values, input_.channels, number);
    for (size_t i = 0; i < mono.size(); ++i) mono[i] += channel[i] / std::ssize(audible_);
  }
  finder_.push(mono);
}

void SoundCheck::search_silence(int64_t samples) {
  const std::vector<float> second(static_cast<size_t>(input_.rate_hz));
  for (int64_t left = samples; left > 0; left -= std::ssize(second)) {
    finder_.push(std::span(second).first(static_cast<size_t>(std::min(left, std::ssize(second)))));
  }
}

CheckedSound SoundCheck::close() {
  receiver_.stop();
  take_pulses();
  track_.finish();
  if (track_.samples() == 0) return {.fault = "no sound came from " + input_.device};
  const sound::MappedPulses mapped = track_.pulses();
  if (!mapped.map.is_known()) return {.fault = "no pulse has a position in the sound"};
  CheckedSound checked{.uncertainty_s = mapped.uncertainty_s};
  if (const auto& clap = finder_.clap(); clap && searched_from_) {
    checked.clap_pulse = mapped.map.pulse_of(static_cast<double>(*searched_from_) + clap->sample);
  }
  return checked;
}

}  // namespace v3d::captured
