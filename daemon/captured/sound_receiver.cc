#include "daemon/captured/sound_receiver.h"

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

}  // namespace v3d::captured
