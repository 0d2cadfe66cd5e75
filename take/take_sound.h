// The sound and the timecode of a take, by its pulses.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sound/pulse_map.h"
#include "sound/timecode.h"
#include "sound/wave_file.h"
#include "take/ledger/sound_ledger.h"
#include "take/take.h"

namespace v3d::take {

/// The channels of a sound file that have neither pulses nor timecode, from 1, by the studio file
/// of the take. All channels for a take without a studio file.
std::vector<int> audible_channels(const SoundLedger& sound, const std::optional<Studio>& studio);

/// The sound of a take in step with its pulses, as two channels: the sum of all its files that have
/// a map of pulses. Odd audible channels are on the left, even ones on the right; a single one is
/// on both sides. One thread.
class TakeSound {
 public:
  /// Opens the sound files that the ledger lists. Throws InputError for a file that cannot be read,
  /// and as load_ledger() does. A take without a ledger, as an imported one, has no sound.
  explicit TakeSound(const TakePaths& paths);

  /// True when no file has a map.
  bool is_silent() const { return files_.empty(); }
  /// The files without a map of pulses: these cannot be played in step.
  const std::vector<std::string>& files_without_map() const { return files_without_map_; }

  /// Uncertainty of the positions of pulses, s: one standard deviation, of the file with the
  /// greatest.
  double uncertainty_s() const;

  /// `count` samples, left and right in turn, of full scale. Sample k is what was recorded at pulse
  /// `first` + k * `step`; the leading edge of pulse n is at n. Silence before and after a file.
  /// The sound is resampled (sound::interpolate()). Throws InputError when a file cannot be read.
  std::vector<float> read(double first, double step, int64_t count);

 private:
  struct File {
    sound::WaveReader wave;
    sound::PulseMap map;
    std::vector<int> channels;
    double uncertainty_s = 0;
  };

  static void add(File& file, double first, double step, std::vector<float>& mix);

  std::vector<File> files_;
  std::vector<std::string> files_without_map_;
};

// TakeTimecode: the timecode of the pulses of a take.

/// A timecode with its place within the frame.
struct PulseTimecode {
  sound::TimecodeRate rate = sound::TimecodeRate::k25;
  double frames = 0;  ///< since midnight, may exceed a day

  sound::Timecode timecode() const;
  std::string text() const;  ///< sound::timecode_text()
};

/// The timecode of each pulse, by the maps of pulses and the runs of timecode in the ledger. Only
/// sound files whose source of timecode has the highest rank in the take count. Thread-safe.
class TakeTimecode {
 public:
  /// Throws as load_ledger(). A take without a ledger, or without sound, has no timecode.
  explicit TakeTimecode(const TakePaths& paths);

  /// The timecode at the leading edge of a pulse. Before the first timecode of the take it is
  /// continued backwards, as for first_timecode of the ledger. Empty where it is unknown: more than
  /// a second away from later timecode.
  std::optional<PulseTimecode> at(int64_t pulse) const;

 private:
  std::optional<PulseTimecode> before_the_first(int64_t pulse) const;

  struct File {
    sound::TimecodeRate rate;
    SoundLedger sound;
  };
  std::vector<File> files_;
};

}  // namespace v3d::take
