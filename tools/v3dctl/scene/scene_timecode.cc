#include "v3dctl/scene/scene_timecode.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "base/core/text.h"

namespace v3d::ctl {
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
  if (!is_playing) {  // held or hidden: the timecode that it had, if it went on
    timecode->frames +=
        (after_in - shown) / clip.rate_hz * sound::frames_per_second(timecode->rate);
  }
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
