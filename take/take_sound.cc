#include "take/take_sound.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "base/core/error.h"
#include "base/io/file.h"
#include "sound/pulse_edges.h"
#include "sound/sound_track.h"
#include "take/ledger/ledger.h"

namespace v3d::take {
namespace {

constexpr double kFullScale = 2147483648.0;

/// Consecutive samples of a file, as left and right.
struct Stereo {
  int64_t first = 0;
  std::vector<float> left, right;
};

void add_channel(const std::vector<int32_t>& values, size_t channels, size_t channel,
                 std::vector<float>& side) {
  for (size_t i = 0; i < side.size(); ++i) {
    side[i] += static_cast<float>(values[i * channels + channel] / kFullScale);
  }
}

/// Reads the samples [first, end) of the file that exist.
Stereo read_stereo(sound::WaveReader& wave, const std::vector<int>& audible, int64_t first,
                   int64_t end) {
  Stereo stereo;
  stereo.first = std::clamp<int64_t>(first, 0, wave.samples());
  const int64_t count = std::clamp<int64_t>(end, stereo.first, wave.samples()) - stereo.first;
  const auto values = io::value_or_throw(wave.read(stereo.first, count));
  const auto channels = static_cast<size_t>(wave.format().channels);
  stereo.left.resize(values.size() / channels);
  stereo.right.resize(values.size() / channels);
  for (size_t i = 0; i < audible.size(); ++i) {
    const auto channel = static_cast<size_t>(audible[i] - 1);
    const bool is_single = audible.size() == 1;
    if (i % 2 == 0) add_channel(values, channels, channel, stereo.left);
    if (i % 2 == 1 || is_single) add_channel(values, channels, channel, stereo.right);
  }
  return stereo;
}

}  // namespace

std::vector<int> audible_channels(const SoundLedger& sound, const std::optional<Studio>& studio) {
  const StudioSound* const input = studio ? studio->sound_of(sound.node) : nullptr;
  StudioSound recorded = input != nullptr ? *input : StudioSound{};
  recorded.channels = sound.channels;
  return sound::audible_channels(recorded);
}

TakeSound::TakeSound(const TakePaths& paths) {
  const auto type = io::value_or_throw(io::entry_type_of(paths.ledger()));
  if (type == std::filesystem::file_type::not_found) return;
  const std::vector<SoundLedger> sounds = load_ledger(paths.ledger()).sounds;
  if (sounds.empty()) return;
  const std::optional<Studio> studio = load_take_studio(paths);
  for (const SoundLedger& sound : sounds) {
    if (!sound.map.is_known()) {
      files_without_map_.push_back(sound.file);
      continue;
    }
    // A ledger from elsewhere may name any path.
    const auto path = paths.sound() / std::filesystem::path(sound.file).filename();
    auto wave = io::value_or_throw(sound::WaveReader::open(path));
    if (wave.format().channels != sound.channels) {
      throw InputError(path.string() + ": has " + std::to_string(wave.format().channels) +
                       " channels; expected " + std::to_string(sound.channels) +
                       ", as in the ledger");
    }
    files_.push_back(
        {std::move(wave), sound.map, audible_channels(sound, studio), 1e-6 * sound.uncertainty_us});
  }
}

double TakeSound::uncertainty_s() const {
  double greatest = 0;
  for (const File& file : files_) greatest = std::max(greatest, file.uncertainty_s);
  return greatest;
}

std::vector<float> TakeSound::read(double first, double step, int64_t count) {
  std::vector<float> mix(static_cast<size_t>(2 * count));
  for (File& file : files_) add(file, first, step, mix);
  for (float& value : mix) value = std::clamp(value, -1.0F, 1.0F);
  return mix;
}

void TakeSound::add(File& file, double first, double step, std::vector<float>& mix) {
  const auto position = [&](size_t k) {
    return file.map.sample_of(first + static_cast<double>(k) * step);
  };
  const size_t count = mix.size() / 2;
  if (count == 0) return;
  // Far outside of the file the positions would not fit into 64 bits.
  const auto length = static_cast<double>(file.wave.samples());
  const double begin = std::clamp(position(0), -1e3, length + 1e3);
  const double end = std::clamp(position(count - 1), -1e3, length + 1e3);
  const Stereo stereo = read_stereo(file.wave, file.channels,
                                    static_cast<int64_t>(std::floor(begin)) - sound::kKernel,
                                    static_cast<int64_t>(std::floor(end)) + sound::kKernel + 2);
  if (stereo.left.empty()) return;
  for (size_t k = 0; k < count; ++k) {
    const double at = position(k);
    if (at < 0 || at > length - 1) continue;
    const double index = at - static_cast<double>(stereo.first);
    mix[2 * k] += static_cast<float>(sound::interpolate(stereo.left, index));
    mix[2 * k + 1] += static_cast<float>(sound::interpolate(stereo.right, index));
  }
}

sound::Timecode PulseTimecode::timecode() const {
  return sound::timecode_of(std::llround(std::floor(frames)), rate);
}

std::string PulseTimecode::text() const { return sound::timecode_text(timecode(), rate); }

TakeTimecode::TakeTimecode(const TakePaths& paths) {
  const auto type = io::value_or_throw(io::entry_type_of(paths.ledger()));
  if (type == std::filesystem::file_type::not_found) return;
  std::vector<SoundLedger> sounds = load_ledger(paths.ledger()).sounds;
  int rank = 0;
  for (SoundLedger& sound : sounds) {
    const auto rate = sound::timecode_rate_from_name(sound.timecode_rate);
    const bool is_known = rate && sound.map.is_known() && !sound.timecode_runs.empty();
    if (!is_known) continue;
    rank = std::max(rank, timecode_rank(sound));
    files_.push_back({.rate = *rate, .sound = std::move(sound)});
  }
  std::erase_if(files_, [&](const auto& file) { return timecode_rank(file.sound) < rank; });
}

std::optional<PulseTimecode> TakeTimecode::at(int64_t pulse) const {
  for (const auto& [rate, sound] : files_) {
    const double sample = sound.map.sample_of(static_cast<double>(pulse));
    if (const auto frames =
            sound::timecode_frames_at(sound.timecode_runs, rate, sound.rate_hz, sample)) {
      return PulseTimecode{.rate = rate, .frames = *frames};
    }
  }
  return before_the_first(pulse);
}

/// By the file whose timecode begins first. Empty when timecode of any file begins before the
/// pulse: it may have jumped since.
std::optional<PulseTimecode> TakeTimecode::before_the_first(int64_t pulse) const {
  constexpr double kAnyDistance = std::numeric_limits<double>::infinity();
  const File* first = nullptr;
  double least_s = kAnyDistance;
  for (const File& file : files_) {
    const auto run =
        std::ranges::min_element(file.sound.timecode_runs, {}, &sound::TimecodeRun::first_sample);
    const double sample = file.sound.map.sample_of(static_cast<double>(pulse));
    const double distance_s = (run->first_sample - sample) / file.sound.rate_hz;
    if (distance_s <= 0) return std::nullopt;
    if (distance_s < least_s) {
      first = &file;
      least_s = distance_s;
    }
  }
  if (first == nullptr) return std::nullopt;
  const auto frames = sound::timecode_frames_at(
      first->sound.timecode_runs, first->rate, first->sound.rate_hz,
      first->sound.map.sample_of(static_cast<double>(pulse)), kAnyDistance);
  return frames ? std::optional(PulseTimecode{.rate = first->rate, .frames = *frames})
                : std::nullopt;
}

}  // namespace v3d::take
