#include "sound/sound_track.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace v3d::sound {
namespace {

constexpr double kFullScale = 2147483648.0;
/// Deviation of a length that is estimated from one time stamp.
constexpr Duration kEstimate = std::chrono::milliseconds(2);
/// Of silence in the file: a time stamp may be damaged.
constexpr int64_t kMaxGapSeconds = 600;

PulseMapper::Setup mapper_setup(const SoundTrack::Setup& setup) {
  return {.rate_hz = setup.sound.rate_hz,
          .pulse_rate_hz = setup.pulse_rate_hz,
          .has_pulse_channel = setup.sound.pulse_channel > 0,
          .stamp_uncertainty_s = setup.stamp_uncertainty_s};
}

}  // namespace

std::vector<int> audible_channels(const StudioSound& sound) {
  std::vector<int> channels;
  for (int channel = 1; channel <= sound.channels; ++channel) {
    const bool is_signal = channel == sound.pulse_channel || channel == sound.timecode_channel;
    if (!is_signal) channels.push_back(channel);
  }
  return channels;
}

std::vector<float> channel_of(std::span<const int32_t> values, int channels, int channel) {
  std::vector<float> samples;
  const auto step = static_cast<size_t>(channels);
  samples.reserve(values.size() / step);
  for (size_t i = static_cast<size_t>(channel - 1); i < values.size(); i += step) {
    samples.push_back(static_cast<float>(values[i] / kFullScale));
  }
  return samples;
}

SoundTrack::SoundTrack(const Setup& setup)
    : setup_(setup),
      clock_(setup.sound.rate_hz),
      mapper_(mapper_setup(setup)),
      edges_(setup.sound.rate_hz),
      peaks_(static_cast<size_t>(setup.sound.channels)) {
  if (setup.sound.timecode_channel == 0) return;
  ltc_.emplace(setup.sound.rate_hz);
  timecode_.emplace(setup.sound.rate_hz, timecode_rate_from_name(setup.sound.timecode_rate));
}

int64_t SoundTrack::add(const SoundBlock& block) {
  const auto length = static_cast<int64_t>(block.values.size()) / setup_.sound.channels;
  int64_t silence = 0;
  if (!std::exchange(has_started_, true)) {
    next_position_ = block.position;
    device_xruns_ = block.xruns;
  }
  if (block.xruns != device_xruns_) {
    // Unknown before the first stamps: then the gap is closed up. Soon after another gap, the
    // estimate from before that gap counts.
    const double expected = clock_.has_estimate() ? clock_.sample_at(block.at) : 0;
    const int64_t lost = std::max<int64_t>(0, std::llround(expected) - length - samples_);
    silence = std::min<int64_t>(lost, kMaxGapSeconds * setup_.sound.rate_hz);
    // The clocks must follow by the part of a longer gap that the file does not have.
    const double missing_s = static_cast<double>(lost - silence) / setup_.sound.rate_hz;
    add_silence(silence, kEstimate + from_seconds(missing_s));
  } else if (block.position > next_position_) {
    silence = block.position - next_position_;
    add_silence(silence, Duration(0));
  }
  device_xruns_ = block.xruns;
  next_position_ = block.position + length;
  samples_ += length;
  clock_.add_stamp(samples_, block.at);
  mapper_.add_stamp(samples_, block.at);
  analyse(block.values);
  return silence;
}

void SoundTrack::add_silence(int64_t samples, Duration deviation) {
  ++xruns_;
  lost_samples_ += samples;
  if (gaps_.size() < kMaxGaps) gaps_.push_back({.sample = samples_, .samples = samples});
  clock_.add_gap(deviation);
  mapper_.add_gap(samples_, samples, deviation);
  samples_ += samples;
  // A second at a time: a device may come back after ten minutes.
  const std::vector<float> second(static_cast<size_t>(setup_.sound.rate_hz));
  for (int64_t left = samples; left > 0; left -= std::ssize(second)) {
    const std::span part =
        std::span(second).first(static_cast<size_t>(std::min(left, std::ssize(second))));
    search_pulses(part);
    read_timecode(part);
  }
}

void SoundTrack::analyse(const std::vector<int32_t>& values) {
  for (size_t i = 0; i < values.size(); ++i) {
    double& peak = peaks_[i % peaks_.size()];
    peak = std::max(peak, std::abs(values[i] / kFullScale));
  }
  const int channels = setup_.sound.channels;
  if (setup_.sound.pulse_channel > 0) {
    search_pulses(channel_of(values, channels, setup_.sound.pulse_channel));
  }
  if (ltc_) read_timecode(channel_of(values, channels, setup_.sound.timecode_channel));
}

void SoundTrack::search_pulses(std::span<const float> samples) {
  if (setup_.sound.pulse_channel == 0) return;
  const auto found = edges_.push(samples);
  mapper_.add_edges(found, edges_.searched());
}

void SoundTrack::read_timecode(std::span<const float> samples) {
  if (!ltc_) return;
  for (const LtcFrame& frame : ltc_->push(samples)) timecode_->add(frame);
}

void SoundTrack::finish() {
  if (setup_.sound.pulse_channel > 0) mapper_.add_edges(edges_.finish(), edges_.searched());
  mapper_.finish();
}

std::vector<double> SoundTrack::pop_peaks() {
  std::vector<double> peaks(peaks_.size());
  peaks.swap(peaks_);
  return peaks;
}

}  // namespace v3d::sound
