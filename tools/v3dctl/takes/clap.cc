#include "v3dctl/takes/clap.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "sound/clap.h"
#include "take/logs/frame_log.h"
#include "take/take_sound.h"

namespace v3d::ctl {
namespace {

constexpr int kRateHz = 48'000;
constexpr int64_t kBlock = kRateHz;
constexpr int kRowStep = 4;
constexpr double kSearchSeconds = 0.5;
constexpr double kMinRatio = 5;
constexpr double kStillShare = 0.25;  // of the pictures; the others may show motion
constexpr double kLeastChange = 0.2;  // of 255: the noise of a still picture

/// The clap in the sound, in pulses.
std::optional<double> clap_in_sound(take::TakeSound& sound, const take::TakeInfo& info) {
  sound::ClapFinder finder(kRateHz);
  const double step = info.rate_hz / kRateHz;
  const auto samples = static_cast<int64_t>(static_cast<double>(info.pulses) / step);
  for (int64_t at = 0; at < samples; at += kBlock) {
    const auto stereo = sound.read(static_cast<double>(at) * step, step, kBlock);
    std::vector<float> mono;
    for (size_t i = 0; i < stereo.size(); i += 2) {
      mono.push_back((stereo[i] + stereo[i + 1]) / 2);
    }
    finder.push(mono);
  }
  if (!finder.clap()) return std::nullopt;
  return finder.clap()->sample * step;
}

/// The stop of a motion in the frames of one camera, near a pulse.
std::optional<double> stop_in_frames(const std::filesystem::path& log, double pulse,
                                     double rate_hz) {
  take::FrameLogReader frames(log);
  const auto first = static_cast<int64_t>(std::floor(pulse - kSearchSeconds * rate_hz));
  const auto last = static_cast<int64_t>(std::ceil(pulse + kSearchSeconds * rate_hz));
  std::vector<double> changes;
  std::optional<Frame> before;
  for (int64_t n = std::max<int64_t>(0, first); n <= last; ++n) {
    auto frame = frames.read(n);
    const bool is_comparable = frame && before && frame->image.size == before->image.size &&
                               frame->image.format == before->image.format;
    if (n > first && before && !is_comparable) return std::nullopt;  // a gap
    changes.push_back(is_comparable ? image_change(before->image.view(), frame->image.view()) : 0);
    before = std::move(frame);
  }
  const auto stop = stop_of_motion(changes);
  if (!stop) return std::nullopt;
  return static_cast<double>(std::max<int64_t>(0, first)) + *stop;
}

}  // namespace

double image_change(ImageView a, ImageView b) {
  int64_t sum = 0, count = 0;
  const int bytes = a.size.width * bytes_per_pixel(a.format);
  for (int y = 0; y < a.size.height; y += kRowStep) {
    for (int x = 0; x < bytes; ++x, ++count) sum += std::abs(a.row(y)[x] - b.row(y)[x]);
  }
  return count > 0 ? static_cast<double>(sum) / static_cast<double>(count) : 0;
}

std::optional<double> stop_of_motion(std::span<const double> changes) {
  if (changes.size() < 4) return std::nullopt;
  const std::vector<double> all(changes.begin() + 1, changes.end());
  const double still = std::max(kLeastChange, percentile(all, kStillShare));
  size_t stop = 1;
  const auto drop = [&](size_t k) { return changes[k] - changes[k + 2]; };
  for (size_t k = 1; k + 2 < changes.size(); ++k) {
    if (drop(k) > drop(stop)) stop = k;
  }
  if (drop(stop) < kMinRatio * still) return std::nullopt;
  const double part = (changes[stop + 1] - changes[stop + 2]) / drop(stop);
  return static_cast<double>(stop) + std::clamp(part, 0.0, 1.0);
}

std::optional<TakeClap> find_take_clap(const take::TakePaths& paths) {
  const take::TakeInfo info = load_take_info(paths);
  take::TakeSound sound(paths);
  if (sound.is_silent()) {
    throw InputError(paths.folder.string() +
                     ": has no sound with a map of its pulses; expected a take of a studio with "
                     "[[sound]]");
  }
  const auto heard = clap_in_sound(sound, info);
  if (!heard) return std::nullopt;
  TakeClap clap{.sound_pulse = *heard, .picture_pulse = {}, .rate_hz = info.rate_hz};
  std::vector<double> stops;
  for (const std::string& camera : info.cameras) {
    const auto stop = stop_in_frames(paths.frames(camera), *heard, info.rate_hz);
    if (stop) stops.push_back(*stop);
  }
  clap.cameras = std::ssize(stops);
  if (!stops.empty()) clap.picture_pulse = upper_median(stops);
  return clap;
}

}  // namespace v3d::ctl
