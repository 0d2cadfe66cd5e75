// Receivers of blocks of sound and pulses: in a thread of their own, and in a check.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/config/studio_file.h"
#include "capture/sync/pulse_times.h"
#include "daemon/bus/subscription_queue.h"
#include "sound/level_monitor.h"
#include "sound/sound_device.h"
#include "sound/sound_track.h"

namespace v3d::captured {

// Blocks of sound and pulses of one train, in a thread of their own.

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

// Sound of a check: detects a clap, and records nothing.

/// Result of the clap detection in a check.
struct CheckedSound {
  std::string fault{};                 ///< why no clap can be detected; empty: none
  std::optional<double> clap_pulse{};  ///< position of the loudest clap, pulses; empty: no clap
  double uncertainty_s = 0;            ///< of that position, one standard deviation
};

/// Searches the audible channels for a clap from the first pulse on, in a thread of its own.
class SoundCheck {
 public:
  /// `queue`: the blocks of the device.
  SoundCheck(const sound::SoundTrack::Setup& setup, std::shared_ptr<SoundQueue> queue);

  /// A pulse of the train. Any thread.
  void pulse_at(const capture::PulseEdge& edge) { receiver_.pulse_at(edge); }

  /// Processes the blocks that the queue holds and stops the thread. Only the destructor may be
  /// called afterwards.
  CheckedSound close();

 private:
  void process(const sound::SoundBlock& block);
  void search_silence(int64_t samples);
  void take_pulses();

  const StudioSound input_;
  const std::vector<int> audible_;
  sound::SoundTrack track_;  ///< this and the next three: the thread, until close()
  sound::ClapFinder finder_;
  std::optional<MonotonicInstant> first_pulse_;
  std::optional<int64_t> searched_from_;  ///< sample; empty before the first pulse
  SoundReceiver receiver_;                ///< last member
};

}  // namespace v3d::captured
