#include "v3dctl/scene/scene_sound.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "base/core/text.h"
#include "base/io/file.h"
#include "common/console.h"
#include "sound/wave_file.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kBlock = kSceneSoundRate / 10;
constexpr double kFullScale = 2147483647.0;

int64_t samples_of(double seconds) { return std::llround(seconds * kSceneSoundRate); }

/// `a` modulo `b`, 0 or more.
int64_t modulo(int64_t a, int64_t b) { return ((a % b) + b) % b; }

}  // namespace

ClipSound::ClipSound(SoundClip clip, take::TakeSound sound, double begin_s)
    : clip_(std::move(clip)),
      gain_(static_cast<float>(std::pow(10, clip_.take.sound_gain_db / 20))),
      pass_(std::max<int64_t>(1, samples_of(static_cast<double>(clip_.part.length) /
                                            (clip_.rate_hz * clip_.take.speed)))),
      sound_(std::move(sound)),
      position_(samples_of(begin_s - clip_.take.start_s - clip_.take.sound_shift_s)) {}

void ClipSound::add_to(std::vector<float>& mix) {
  for (size_t done = 0; done < mix.size();) {
    const Run run = next_run(static_cast<int64_t>(mix.size() - done) / 2);
    if (!run.is_silent) {
      const std::vector<float> samples = read(run);
      for (size_t i = 0; i < samples.size(); ++i) mix[done + i] += gain_ * samples[i];
    }
    position_ += run.samples;
    done += 2 * static_cast<size_t>(run.samples);
  }
}

ClipSound::Run ClipSound::next_run(int64_t limit) const {
  const double speed = clip_.take.speed;
  const bool is_heard = speed >= kMinSpeed && speed <= kMaxSpeed;
  const int64_t phase = clip_.take.outside == Outside::kLoop ? modulo(position_, pass_) : position_;
  if (!is_heard || phase >= pass_) return {.samples = limit};
  if (phase < 0) return {.samples = std::min(limit, -phase)};
  return {.is_silent = false, .phase = phase, .samples = std::min(limit, pass_ - phase)};
}

double ClipSound::pulse_at_phase(int64_t phase) const {
  const double seconds = static_cast<double>(phase) / kSceneSoundRate;
  return static_cast<double>(clip_.part.in) + seconds * clip_.take.speed * clip_.rate_hz;
}

std::vector<float> ClipSound::read(const Run& run) {
  if (clip_.take.speed != 1) return read_stretched(run);
  return sound_.read(pulse_at_phase(run.phase), clip_.rate_hz / kSceneSoundRate, run.samples);
}

std::vector<float> ClipSound::read_stretched(const Run& run) {
  if (!stretcher_ || run.phase != stretched_until_) {
    stretcher_.emplace(kSceneSoundRate, clip_.take.speed);
    source_pulse_ =
        pulse_at_phase(run.phase) - TimeStretch::lead_s(clip_.take.speed) * clip_.rate_hz;
  }
  std::vector<float> samples(2 * static_cast<size_t>(run.samples));
  const double step = clip_.rate_hz / kSceneSoundRate;
  while (!stretcher_->pop(samples)) {
    stretcher_->push(sound_.read(source_pulse_, step, kBlock));
    source_pulse_ += step * kBlock;
  }
  stretched_until_ = run.phase + run.samples;
  return samples;
}

SceneSound::SceneSound(const std::vector<SoundClip>& clips, double begin_s) {
  for (const SoundClip& clip : clips) {
    if (!clip.take.sound) continue;
    take::TakeSound sound(take::TakePaths{clip.take.take});
    for (const std::string& file : sound.files_without_map()) {
      unplayed_.push_back((clip.take.take / file).string());
    }
    if (!sound.is_silent()) clips_.emplace_back(clip, std::move(sound), begin_s);
  }
}

std::vector<float> SceneSound::next(int64_t samples) {
  std::vector<float> mix(2 * static_cast<size_t>(samples));
  for (ClipSound& clip : clips_) clip.add_to(mix);
  for (float& value : mix) value = std::clamp(value, -1.0F, 1.0F);
  return mix;
}

SceneSoundFile::SceneSoundFile(SceneSound& sound, const fs::path& video, double seconds)
    : file_(video.parent_path() / (video.filename().string() + ".wav")) {
  auto file = sound::WaveWriter::create(path(), {.rate_hz = kSceneSoundRate, .channels = 2}, {});
  io::throw_if_failed(file ? io::Status() : tl::make_unexpected(file.error()));
  for (int64_t left = samples_of(seconds); left > 0; left -= kBlock) {
    stop_if_interrupted();
    std::vector<int32_t> values;
    for (const float value : sound.next(std::min(left, kBlock))) {
      values.push_back(static_cast<int32_t>(std::lround(kFullScale * value)));
    }
    io::throw_if_failed(file->write(values));
  }
}

namespace {

/// Distance of a pulse from the edge of a picture that is no difference, pictures.
constexpr double kTolerance = 1e-3;

bool counts_as_2997(double pictures_per_second) {
  return std::abs(pictures_per_second - 29.97) < 0.005 ||
         std::abs(pictures_per_second - 59.94) < 0.005;
}

/// The timecode of a take, at a time of the scene where the take plays or would play.
struct ClipTimecode {
  std::string take;
  take::PulseTimecode timecode;
};

std::optional<ClipTimecode> timecode_of(const SoundClip& clip, double seconds) {
  const double after_in = (seconds - clip.take.start_s) * clip.rate_hz;  // pulses
  const double shown = std::clamp<double>(std::floor(after_in + kTolerance), 0,
                                          static_cast<double>(clip.part.length - 1));
  const take::TakeTimecode timecodes({clip.take.take});
  auto timecode = timecodes.at(clip.part.in + static_cast<int64_t>(shown));
  if (!timecode) return std::nullopt;
  const bool is_playing = after_in + kTolerance >= 0 && shown + 1 > after_in;
  // A take that is held or hidden has the timecode that it had, if it went on.
  const double since = is_playing ? std::max(0.0, after_in - shown) : after_in - shown;
  timecode->frames += since / clip.rate_hz * sound::frames_per_second(timecode->rate);
  return ClipTimecode{clip.take.take.filename().string(), *timecode};
}

bool agree(const take::PulseTimecode& a, const take::PulseTimecode& b, double pictures_per_second) {
  if (a.rate != b.rate) return false;
  const double frames =
      std::remainder(a.frames - b.frames, static_cast<double>(sound::frames_per_day(a.rate)));
  return std::abs(frames) / sound::frames_per_second(a.rate) * pictures_per_second <= 0.5;
}

/// Why there is no timecode that fits all; empty: there is one.
std::string disagreement(const std::vector<ClipTimecode>& timecodes, double pictures_per_second) {
  const ClipTimecode& first = timecodes.front();
  for (const ClipTimecode& other : timecodes) {
    if (!agree(first.timecode, other.timecode, pictures_per_second)) {
      return fmt::format("{} is at {}, {} at {}", first.take, first.timecode.text(), other.take,
                         other.timecode.text());
    }
  }
  return "";
}

}  // namespace

std::string video_timecode(const take::PulseTimecode& timecode, double pictures_per_second) {
  const int counted = std::max(1, static_cast<int>(std::lround(pictures_per_second)));
  const double fraction = timecode.frames - std::floor(timecode.frames);
  const sound::Timecode t = timecode.timecode();
  const double second = (t.frames + fraction) / sound::counted_frames(timecode.rate);
  const int picture =
      std::min(counted - 1, static_cast<int>(std::floor(second * counted + kTolerance)));
  const bool drops =
      timecode.rate == sound::TimecodeRate::k2997Drop && counts_as_2997(pictures_per_second);
  return fmt::format("{:02}:{:02}:{:02}{}{:02}", t.hours, t.minutes, t.seconds, drops ? ';' : ':',
                     picture);
}

SceneTimecode scene_timecode(std::span<const SoundClip> clips, double seconds,
                             double pictures_per_second) {
  std::vector<ClipTimecode> timecodes;
  for (const SoundClip& clip : clips) {
    auto timecode = timecode_of(clip, seconds);
    if (!timecode) continue;
    if (clip.take.speed != 1) {
      return {"", timecode->take + " plays at another speed than 1"};
    }
    if (clip.take.outside == Outside::kLoop) return {"", timecode->take + " repeats"};
    timecodes.push_back(*std::move(timecode));
  }
  if (timecodes.empty()) return {};
  std::string problem = disagreement(timecodes, pictures_per_second);
  if (!problem.empty()) return {"", std::move(problem)};
  return {video_timecode(timecodes.front().timecode, pictures_per_second), ""};
}

}  // namespace v3d::ctl
