// A take with sound, for tests.
#pragma once

#include <cmath>
#include <filesystem>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "base/io/file.h"
#include "sound/wave_file.h"
#include "support/begun_take.h"
#include "take/ledger/ledger.h"
#include "take/take.h"

namespace v3d::test {

inline constexpr double kSoundingPulseRate = 25;

/// The value of a channel at a sample, of full scale.
using Signal = std::function<double(int64_t sample, int channel)>;

/// Writes the sound of cap01 into the folder of a take. `map`: its pulses in the sound. Returns its
/// entry in the ledger.
inline take::SoundLedger write_sound(const take::TakePaths& paths, const sound::PulseMap& map,
                                     int64_t samples, int channels, const Signal& signal) {
  std::filesystem::create_directories(paths.sound());
  auto writer = io::value_or_throw(sound::WaveWriter::create(
      paths.sound() / "cap01.wav", {.rate_hz = 48'000, .channels = channels}, {}));
  std::vector<int32_t> values;
  for (int64_t sample = 0; sample < samples; ++sample) {
    for (int channel = 1; channel <= channels; ++channel) {
      values.push_back(static_cast<int32_t>(std::lround(signal(sample, channel) * 2147483392.0)));
    }
  }
  io::throw_if_failed(writer.write(values));
  return {.file = "sound/cap01.wav",
          .node = "cap01",
          .rate_hz = 48'000,
          .channels = channels,
          .samples = samples,
          .map_source = map.is_known() ? "pulse channel" : "none",
          .map = map};
}

/// A take of 25 pulses a second with write_sound(), without cameras.
inline void write_sounding_take(const take::TakePaths& paths, const sound::PulseMap& map,
                                int64_t samples, int channels, const Signal& signal) {
  take::Ledger ledger{.take = "kendo-07", .commanded = 0, .sensed = {}, .cameras = {}};
  ledger.sounds.push_back(write_sound(paths, map, samples, channels, signal));
  io::throw_if_failed(save_take_info(paths, begun_take({})));
  io::throw_if_failed(save_ledger(paths.ledger(), ledger));
}

/// The ledger's entry of 48 kHz sound with timecode: pulse 0 is at sample 1000.
inline take::SoundLedger timecoded_sound(const std::string& source, const std::string& rate,
                                         std::vector<sound::TimecodeRun> runs) {
  return {.file = "sound/cap01.wav",
          .node = "cap01",
          .rate_hz = 48'000,
          .channels = 1,
          .samples = 200'000,
          .map_source = "pulse channel",
          .map = {{{0, 1000}, {100, 1000 + 100 * 48'000 / kSoundingPulseRate}}},
          .timecode_source = source,
          .timecode_rate = rate,
          .timecode_runs = std::move(runs)};
}

/// Writes a ledger with these sounds into the folder of a take, without their files.
inline void write_sounds_of_ledger(const take::TakePaths& paths,
                                   std::vector<take::SoundLedger> sounds) {
  take::Ledger ledger{.take = "kendo-07", .commanded = 100, .sensed = {}, .cameras = {}};
  ledger.sounds = std::move(sounds);
  std::filesystem::create_directories(paths.folder);
  io::throw_if_failed(save_ledger(paths.ledger(), ledger));
}

/// A burst of 4 ms of 1 kHz, loudest 2 ms after `at`, at a sample of a file of 48 kHz.
inline double burst(double sample, double at) {
  constexpr double kLength = 192;
  const double t = sample - at;
  if (t < 0 || t > kLength) return 0;
  const double window = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * t / kLength);
  return 0.8 * window * std::cos(2 * std::numbers::pi * (t - kLength / 2) / 48);
}

/// Where the energy of one side is, in samples: its centre of gravity. `stereo`: left and right in
/// turn.
inline double centre_of_sound(const std::vector<float>& stereo, size_t side = 0) {
  double sum = 0, weighted = 0;
  for (size_t i = side; i < stereo.size(); i += 2) {
    const double energy = static_cast<double>(stereo[i]) * stereo[i];
    sum += energy;
    weighted += energy * static_cast<double>(i / 2);
  }
  return sum > 0 ? weighted / sum : -1;
}

}  // namespace v3d::test
