#include "sound/level_monitor.h"

#include <algorithm>
#include <cmath>

#include "base/core/error.h"
#include "sound/sound_track.h"

namespace v3d::sound {

double decibels_of(double ratio) {
  constexpr double kMinDbfs = -150;
  return ratio > 0 ? std::max(kMinDbfs, 20 * std::log10(ratio)) : kMinDbfs;
}

LevelMonitor::LevelMonitor(const StudioSound& sound)
    : hold_(std::llround(kHoldSeconds * sound.rate_hz)) {
  for (const int channel : audible_channels(sound)) channels_.push_back({.channel = channel});
}

void LevelMonitor::add(std::span<const double> peaks, int64_t samples) {
  for (Channel& channel : channels_) {
    V3D_CHECK(static_cast<size_t>(channel.channel) <= peaks.size());
    const double dbfs = decibels_of(peaks[static_cast<size_t>(channel.channel - 1)]);
    channel.clipping =
        dbfs >= kClippingDbfs ? hold_ : std::max<int64_t>(0, channel.clipping - samples);
    channel.silent = dbfs < kSilenceDbfs ? std::min(hold_, channel.silent + samples) : 0;
  }
}

void LevelMonitor::reset() {
  for (Channel& channel : channels_) channel = {.channel = channel.channel};
}

std::vector<ChannelFault> LevelMonitor::faults() const {
  std::vector<ChannelFault> faults;
  for (const Channel& channel : channels_) {
    if (channel.clipping > 0) {
      faults.push_back({channel.channel, LevelFault::kClips});
    } else if (channel.silent >= hold_) {
      faults.push_back({channel.channel, LevelFault::kSilent});
    }
  }
  return faults;
}

}  // namespace v3d::sound
