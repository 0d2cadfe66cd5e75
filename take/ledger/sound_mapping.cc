#include "take/ledger/sound_mapping.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string>

#include "base/core/error.h"
#include "sound/timecode.h"
#include "sound/wave_file.h"
#include "take/logs/frame_log.h"

namespace v3d::take {
namespace {

/// Blocks of the file, as of a device.
constexpr int kBlocksPerSecond = 10;
/// The drift is measured again after so many.
constexpr int kBlocksPerDrift = 50;
/// Deviation of the position by the wall clocks of two PCs, s.
constexpr double kClockDeviation = 2e-3;
/// Deviation of the rate of a sample clock.
constexpr double kDriftDeviation = 50e-6;
/// No sample clock is off by more; the edges of such a drift are not those of the pulses.
constexpr double kMaxDrift = 1e-3;

struct RecordedPulses {
  std::vector<wire::PulseMessage> pulses;  ///< in order
  double rate_hz = 0;
};

/// How a node recorded its sound, as far as the take knows.
StudioSound settings_of(const std::optional<Studio>& studio, const SoundLedger& sound) {
  const StudioSound* const known = studio ? studio->sound_of(sound.node) : nullptr;
  StudioSound settings = known != nullptr ? *known : StudioSound{};
  if (settings.pulse_channel > sound.channels) settings.pulse_channel = 0;
  if (settings.timecode_channel > sound.channels) settings.timecode_channel = 0;
  settings.channels = sound.channels;
  settings.rate_hz = sound.rate_hz;
  return settings;
}

/// The clock of a file: time stamps of its samples, from 0 at the first one. The sample clock parts
/// from the host's by a period of the pulses within minutes, so its drift is measured by the edges
/// that were found.
class FileClock {
 public:
  FileClock(const RecordedPulses& recorded, int rate_hz) : recorded_(recorded), rate_hz_(rate_hz) {}

  MonotonicInstant advance(int64_t samples) {
    seconds_ += static_cast<double>(samples) / (rate_hz_ * (1 + drift_));
    return MonotonicInstant(from_seconds(seconds_));
  }

  void measure_drift(const sound::MappedPulses& mapped) {
    if (mapped.source != sound::MapSource::kPulseChannel) return;
    const auto& first = mapped.map.knots.front();
    const auto& last = mapped.map.knots.back();
    const auto begin = edge_of(first.pulse), end = edge_of(last.pulse);
    if (!begin || !end || *end <= *begin) return;
    const double drift = (last.sample - first.sample) / (to_seconds(*end - *begin) * rate_hz_) - 1;
    if (std::abs(drift) <= kMaxDrift) drift_ = drift;
  }

 private:
  std::optional<RealtimeInstant> edge_of(double pulse) const {
    const auto found = std::ranges::lower_bound(recorded_.pulses, static_cast<int64_t>(pulse), {},
                                                &wire::PulseMessage::pulse);
    if (found == recorded_.pulses.end()) return std::nullopt;
    return found->edge;
  }

  const RecordedPulses& recorded_;
  const int rate_hz_;
  double drift_ = 0;
  double seconds_ = 0;
};

/// Throws InputError where the file has no map.
void map_sound(const std::filesystem::path& path, const StudioSound& settings,
               const RecordedPulses& recorded, const ReadProgress& progress, SoundLedger& sound) {
  auto wave = io::value_or_throw(sound::WaveReader::open(path));
  const auto begin = sound::first_sample_time(wave.origin(), sound.rate_hz);
  if (!begin) throw InputError(path.string() + ": states no time of its first sample");
  const double seconds = static_cast<double>(wave.samples()) / sound.rate_hz;
  sound::SoundTrack track(
      {.sound = settings,
       .pulse_rate_hz = recorded.rate_hz,
       .stamp_uncertainty_s = std::hypot(kClockDeviation, kDriftDeviation * seconds)});
  std::optional<int64_t> first_pulse;
  int64_t last_pulse = 0;
  auto pulse = recorded.pulses.begin();
  FileClock clock(recorded, sound.rate_hz);
  int blocks = 0;
  for (int64_t sample = 0; sample < wave.samples();) {
    auto values = io::value_or_throw(wave.read(sample, sound.rate_hz / kBlocksPerSecond));
    if (progress) progress();
    const auto length = static_cast<int64_t>(values.size()) / sound.channels;
    if (length == 0) break;
    if (++blocks % kBlocksPerDrift == 0) clock.measure_drift(track.pulses());
    const MonotonicInstant at = clock.advance(length);
    for (; pulse != recorded.pulses.end(); ++pulse) {
      if (pulse->edge < *begin) continue;
      const MonotonicInstant edge(pulse->edge - *begin);
      if (edge > at) break;
      track.add_pulse(pulse->pulse, edge);
      if (!first_pulse) first_pulse = pulse->pulse;
      last_pulse = pulse->pulse;
    }
    track.add({.position = sample, .at = at, .values = std::move(values)});
    sample += length;
  }
  track.finish();
  if (!first_pulse) throw InputError(path.string() + ": no pulse of the take is within its time");
  describe_track(track, *first_pulse, last_pulse, sound);
  if (!sound.map.is_known()) {
    throw InputError(path.string() + ": too few pulses are within its time");
  }
}

}  // namespace

void describe_track(const sound::SoundTrack& track, int64_t first_pulse, int64_t last_pulse,
                    SoundLedger& sound) {
  const sound::MappedPulses mapped = track.pulses();
  sound.map_source = name(mapped.source);
  sound.map = mapped.map;
  sound.uncertainty_us = 1e6 * mapped.uncertainty_s;
  sound.drift_ppm = mapped.drift_ppm;
  sound.missing_edges = mapped.missing_edges;
  sound.extra_edges = mapped.extra_edges;
  const auto& timecode = track.timecode();
  // Its rate may be known by the studio file although there was no LTC.
  if (!timecode || timecode->runs().empty()) return;
  const sound::TimecodeRate rate = *timecode->rate();
  // Where LTC begins later or ends earlier, it is continued, as for sound::first_timecode().
  constexpr double kAnyDistance = std::numeric_limits<double>::infinity();
  const auto text_at = [&](int64_t pulse) -> std::string {
    const auto frames =
        sound::timecode_frames_at(timecode->runs(), rate, sound.rate_hz,
                                  mapped.map.sample_of(static_cast<double>(pulse)), kAnyDistance);
    if (!frames) return "";
    return sound::timecode_text(sound::timecode_of(std::llround(std::floor(*frames)), rate), rate);
  };
  sound.timecode_source = "ltc";
  sound.timecode_rate = name(rate);
  sound.timecode_jumps = timecode->jumps();
  sound.timecode_runs = timecode->runs();
  if (!mapped.map.is_known()) return;
  sound.first_timecode = text_at(first_pulse);
  sound.last_timecode = text_at(last_pulse);
}

std::vector<std::string> map_recorded_sounds(const TakePaths& paths,
                                             std::vector<SoundLedger>& sounds,
                                             const ReadProgress& progress) {
  if (sounds.empty()) return {};
  std::vector<std::string> problems;
  try {
    const RecordedPulses recorded{.pulses = read_pulses(paths.pulses(), progress),
                                  .rate_hz = load_take_info(paths).rate_hz};
    const std::optional<Studio> studio = load_take_studio(paths);
    for (SoundLedger& sound : sounds) {
      const auto path = paths.sound() / std::filesystem::path(sound.file).filename();
      try {
        map_sound(path, settings_of(studio, sound), recorded, progress, sound);
      } catch (const InputError& error) {
        problems.emplace_back(error.what());
      }
    }
  } catch (const InputError& error) {
    problems.emplace_back(error.what());
  }
  return problems;
}

}  // namespace v3d::take
