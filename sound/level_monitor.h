// Levels of a sound input: faults of channels, and claps.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/config/studio_file.h"

namespace v3d::sound {

/// Level of a ratio to full scale, in dBFS; -150 at least.
double decibels_of(double ratio);

/// The condition of one channel.
enum class LevelFault : uint8_t {
  kClips,   ///< a peak reached LevelMonitor::kClippingDbfs in the last kHoldSeconds
  kSilent,  ///< all peaks of the last kHoldSeconds were below LevelMonitor::kSilenceDbfs
};

struct ChannelFault {
  int channel = 0;  ///< from 1
  LevelFault fault{};
  friend bool operator==(const ChannelFault&, const ChannelFault&) = default;
};

/// Judges each audible channel (audible_channels(), sound/sound_track.h) by its peaks. Channels of
/// pulses and timecode have any level. Time is that of the samples. One thread.
class LevelMonitor {
 public:
  /// Below the level at which converters clip, above any peak that a recordist aims at.
  static constexpr double kClippingDbfs = -0.1;
  /// Above the noise of a converter without a microphone, below that of a quiet room.
  static constexpr double kSilenceDbfs = -80;
  static constexpr double kHoldSeconds = 5;

  explicit LevelMonitor(const StudioSound& sound);

  /// Adds the highest absolute value of each channel in the next `samples` samples, of full scale.
  /// Requires one value for every channel of the input.
  void add(std::span<const double> peaks, int64_t samples);
  /// Forgets all samples: after the device was opened again.
  void reset();

  /// The channels with a fault, ascending.
  std::vector<ChannelFault> faults() const;

 private:
  struct Channel {
    int channel = 0;
    int64_t clipping = 0;  ///< samples for which clipping remains reported
    int64_t silent = 0;    ///< samples since the last peak of kSilenceDbfs
  };
  const int64_t hold_;  ///< samples
  std::vector<Channel> channels_;
};

// Finds a clap in sound.

/// A sudden sound.
struct Clap {
  double sample = 0;   ///< of its onset
  double energy = 0;   ///< mean square of its loudest millisecond, of full scale
  double rise_db = 0;  ///< of its energy over that of the 50 ms before
};

/// Finds the loudest sound that begins suddenly, as a clap of hands or of a clapperboard: within
/// 3 ms the energy rises by kMinRiseDb over the mean of the 50 ms before. Its onset is where half
/// of its peak is reached first. Steady sounds, and sounds below -50 dB, are no claps. One thread.
class ClapFinder {
 public:
  static constexpr double kMinRiseDb = 20;

  explicit ClapFinder(int rate_hz);

  /// Adds the next samples of one channel, full scale -1 to 1.
  void push(std::span<const float> samples);
  /// The clap so far. A clap in the last 5 ms is not found.
  const std::optional<Clap>& clap() const { return clap_; }

 private:
  void add_window();
  double onset(int64_t window) const;

  const int64_t window_;       ///< samples of a millisecond
  std::vector<float> buffer_;  ///< samples from start_ on
  int64_t start_ = 0;
  std::vector<double> energies_;  ///< of the windows of buffer_
  std::optional<Clap> clap_;
};

}  // namespace v3d::sound
