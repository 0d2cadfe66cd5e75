// SoundTrack: analysis of a sound recording: levels, gaps, pulses and timecode.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "sound/clock_filter.h"
#include "sound/ltc.h"
#include "sound/pulse_edges.h"
#include "sound/pulse_mapper.h"
#include "sound/sound_device.h"
#include "sound/timecode.h"

namespace v3d::sound {

/// Samples that were lost. The file has silence of the estimated length there.
struct SoundGap {
  int64_t sample = 0;  ///< position in the file
  int64_t samples = 0;
  friend bool operator==(const SoundGap&, const SoundGap&) = default;
};

/// The channels of an input that have neither pulses nor timecode, from 1.
std::vector<int> audible_channels(const StudioSound& sound);

/// The values of one channel, from 1, of interleaved ones; of full scale.
std::vector<float> channel_of(std::span<const int32_t> values, int channels, int channel);

/// Analyses the blocks of a device on their way to the file. Xruns and blocks that were dropped
/// before become gaps: their length is known from the block's position, or estimated from its time
/// stamp. One thread.
class SoundTrack {
 public:
  static constexpr size_t kMaxGaps = 1000;

  struct Setup {
    StudioSound sound;
    double pulse_rate_hz = 25;
    double stamp_uncertainty_s = 1e-3;
  };
  explicit SoundTrack(const Setup& setup);

  /// Adds the next block. Returns the number of samples of silence to write before it.
  int64_t add(const SoundBlock& block);
  /// A pulse of the take and its time on this host's clock.
  void add_pulse(int64_t pulse, MonotonicInstant at) { mapper_.add_pulse(pulse, at); }
  /// Call after the last block.
  void finish();

  int64_t samples() const { return samples_; }                 ///< with silence
  int64_t xruns() const { return xruns_; }                     ///< gaps
  int64_t lost_samples() const { return lost_samples_; }       ///< silence of all gaps
  const std::vector<SoundGap>& gaps() const { return gaps_; }  ///< the first kMaxGaps
  MappedPulses pulses() const { return mapper_.result(); }
  const std::optional<TimecodeTrack>& timecode() const { return timecode_; }

  /// The highest absolute value of a channel since the last call, of full scale.
  std::vector<double> pop_peaks();

 private:
  void add_silence(int64_t samples, Duration deviation);
  void analyse(const std::vector<int32_t>& values);
  void search_pulses(std::span<const float> samples);
  void read_timecode(std::span<const float> samples);

  const Setup setup_;
  SampleClock clock_;
  PulseMapper mapper_;
  PulseEdgeDetector edges_;
  std::optional<LtcReader> ltc_;
  std::optional<TimecodeTrack> timecode_;
  bool has_started_ = false;
  int64_t samples_ = 0;
  int64_t next_position_ = 0;
  int64_t device_xruns_ = 0;
  int64_t xruns_ = 0;
  int64_t lost_samples_ = 0;
  std::vector<SoundGap> gaps_;
  std::vector<double> peaks_;
};

}  // namespace v3d::sound
