// The account of a sound file of a take.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/config/toml_file.h"
#include "base/io/file.h"
#include "sound/pulse_map.h"
#include "sound/timecode.h"
#include "take/take.h"

namespace v3d::take {

/// One sound file, a table [[sound]] of the ledger. A file that was not closed has what
/// map_recorded_sounds() finds (take/ledger/sound_mapping.h).
struct SoundLedger {
  std::string file;  ///< relative to the folder of the take: "sound/cap01.wav"
  std::string node;
  int rate_hz = 0;
  int channels = 0;
  int64_t samples = 0;
  int64_t xruns = 0;         ///< places where samples were lost
  int64_t lost_samples = 0;  ///< length of the silence there
  /// The first such places: position and length of the silence, samples.
  std::vector<std::vector<double>> gaps = {};
  /// What the map was made from: "pulse channel", "time stamps" or "none".
  std::string map_source = "none";
  sound::PulseMap map = {};   ///< pulses to samples
  double uncertainty_us = 0;  ///< of a position in the map
  double drift_ppm = 0;       ///< of the sound clock against the pulses (MappedPulses::drift_ppm)
  int64_t missing_edges = 0;  ///< pulses without an edge in the pulse channel
  int64_t extra_edges = 0;    ///< edges without a pulse
  /// "ltc" in the sound, "output": what the trigger's node put out, "time of day" or "none".
  std::string timecode_source = "none";
  std::string timecode_rate = {};   ///< "29.97df", a name of sound::TimecodeRate
  std::string first_timecode = {};  ///< of the first pulse; empty: unknown
  std::string last_timecode = {};   ///< of the last pulse
  int64_t timecode_jumps = 0;
  std::vector<sound::TimecodeRun> timecode_runs = {};  ///< timecode of the samples

  friend bool operator==(const SoundLedger&, const SoundLedger&) = default;
};

/// Reads and writes a table [[sound]]. Reading throws InputError with file, line and field.
SoundLedger read_sound_ledger(const TomlTable& table);
void write_sound_ledger(const SoundLedger& sound, TomlWriter& file);

/// "480,000 samples of 2 channels at 48,000 Hz"
std::string contents_of(const SoundLedger& sound);
/// Xruns, sound that begins or ends more than a second inside the pulses, a jump of the timecode,
/// no map of pulses and one without edges, on one line; empty without any.
std::string problem_line(const SoundLedger& sound);

/// The rank of a source of timecode: that of "ltc" is the highest, then "output", then others.
int timecode_rank(const SoundLedger& sound);

/// Timecode of the first and the last pulse of a take, from the source of the highest rank:
/// "10:00:00:00 to 10:01:00:00". Empty when it is unknown.
std::string timecode_text(const std::vector<SoundLedger>& sounds);

/// The sound files of a take, as their headers state.
struct ReadSounds {
  std::vector<SoundLedger> sounds;
  std::vector<std::string> problems;  ///< one line for each file that cannot be read
};
/// Reads the headers of all files in the folder `sound`. Fails when it cannot be listed.
[[nodiscard]] io::Result<ReadSounds> read_sounds(const TakePaths& paths);

/// Path of the next sound file of a node: <node>.wav, <node>.0001.wav, ... (segment_path(),
/// take/logs/log_files.h). Fails when the folder cannot be listed.
[[nodiscard]] io::Result<std::filesystem::path> next_sound_file(const TakePaths& paths,
                                                                const std::string& node);

}  // namespace v3d::take
