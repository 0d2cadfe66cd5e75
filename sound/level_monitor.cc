#include "sound/level_monitor.h"

#include <algorithm>
#include <cmath>
#include <numeric>

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

namespace {

/// Windows before a clap, whose mean energy it exceeds, and those in which it rises.
constexpr size_t kBefore = 50;
constexpr size_t kRise = 3;
constexpr double kMinEnergy = 1e-5;  // -50 dB
constexpr double kMinNoise = 1e-9;   // -90 dB: digital silence has no energy

}  // namespace

ClapFinder::ClapFinder(int rate_hz) : window_(rate_hz / 1000) {}

void ClapFinder::push(std::span<const float> samples) {
  buffer_.insert(buffer_.end(), samples.begin(), samples.end());
  while (std::ssize(buffer_) >= window_ * (std::ssize(energies_) + 1)) add_window();
}

/// Compares the window that is kRise windows back with those before it.
void ClapFinder::add_window() {
  const auto begin = buffer_.begin() + window_ * std::ssize(energies_);
  const double sum = std::inner_product(begin, begin + window_, begin, 0.0);
  energies_.push_back(sum / static_cast<double>(window_));
  if (energies_.size() < kBefore + kRise) return;
  const double before =
      std::accumulate(energies_.begin(), energies_.begin() + kBefore, 0.0) / kBefore;
  const double loudest = *std::max_element(energies_.begin() + kBefore, energies_.end());
  const double rise_db = 10 * std::log10(loudest / std::max(before, kMinNoise));
  if (loudest >= kMinEnergy && rise_db >= kMinRiseDb && (!clap_ || loudest > clap_->energy)) {
    clap_ = {.sample = onset(kBefore), .energy = loudest, .rise_db = rise_db};
  }
  energies_.erase(energies_.begin());
  buffer_.erase(buffer_.begin(), buffer_.begin() + window_);
  start_ += window_;
}

/// Where half of the peak of the windows from `window` on is reached first, samples.
double ClapFinder::onset(int64_t window) const {
  const auto begin = buffer_.begin() + window * window_;
  const auto end = buffer_.begin() + std::ssize(energies_) * window_;
  const auto magnitude = [](float a) { return std::abs(a); };
  const float peak = magnitude(*std::ranges::max_element(begin, end, {}, magnitude));
  const auto first =
      std::find_if(begin, end, [&](float value) { return magnitude(value) >= peak / 2; });
  return static_cast<double>(start_ + (first - buffer_.begin()));
}

}  // namespace v3d::sound
