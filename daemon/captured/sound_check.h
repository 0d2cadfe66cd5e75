// Sound of a check: detects a clap, and records nothing.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "daemon/captured/sound_receiver.h"
#include "sound/level_monitor.h"
#include "sound/sound_track.h"

namespace v3d::captured {

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
