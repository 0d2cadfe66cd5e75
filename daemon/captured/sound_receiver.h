// Blocks of sound and pulses of one train, in a thread of their own.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "capture/sync/pulse_times.h"
#include "daemon/bus/subscription_queue.h"
#include "sound/sound_device.h"

namespace v3d::captured {

using SoundQueue = bus::BoundedQueue<sound::SoundBlock>;

/// Passes the blocks of a sound device to a function, in a thread of its own, and keeps the pulses
/// for it.
class SoundReceiver {
 public:
  /// Processes a block.
  using OnBlock = std::function<void(const sound::SoundBlock&)>;

  /// The thread calls `on_block` for every block of `queue`.
  SoundReceiver(std::shared_ptr<SoundQueue> queue, OnBlock on_block);
  /// As stop().
  ~SoundReceiver();
  SoundReceiver(const SoundReceiver&) = delete;
  SoundReceiver& operator=(const SoundReceiver&) = delete;

  /// A pulse of the train. Any thread. Drops pulses that no block follows for minutes.
  void pulse_at(const capture::PulseEdge& edge);
  /// The pulses since the last call. Any thread.
  std::deque<capture::PulseEdge> pop_pulses();

  /// Processes the blocks that the queue holds, and ends the thread.
  void stop();

 private:
  void run();

  const std::shared_ptr<SoundQueue> queue_;
  const OnBlock on_block_;
  std::mutex mutex_;  ///< guards the next member
  std::deque<capture::PulseEdge> pulses_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;  ///< last member
};

}  // namespace v3d::captured
