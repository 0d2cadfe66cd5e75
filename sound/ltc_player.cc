#include "sound/ltc_player.h"

#include <algorithm>
#include <cmath>

namespace v3d::sound {
namespace {

constexpr double kSilenceSeconds = 0.01;
/// A larger distance from the clock is not corrected by the lengths of frames, frames.
constexpr double kMaxError = 0.5;
/// An underrun has an unknown length.
constexpr Duration kUnderrunDeviation = std::chrono::seconds(10);

}  // namespace

LtcPlayer::LtcPlayer(int rate_hz, TimecodeRate rate)
    : rate_hz_(rate_hz), rate_(rate), device_(rate_hz) {}

void LtcPlayer::add_underrun() { device_.add_gap(kUnderrunDeviation); }

std::vector<float> LtcPlayer::next(int64_t count, const TimecodeClock& clock) {
  while (std::ssize(buffer_) < count) append_frame(clock);
  std::vector<float> samples(buffer_.begin(), buffer_.begin() + count);
  buffer_.erase(buffer_.begin(), buffer_.begin() + count);
  return samples;
}

void LtcPlayer::append_silence(double samples) {
  const auto count = std::max<int64_t>(1, std::llround(samples));
  buffer_.resize(buffer_.size() + static_cast<size_t>(count));
  position_ += count;
}

void LtcPlayer::append_frame(const TimecodeClock& clock) {
  if (!device_.is_known()) {
    writer_.reset();
    return append_silence(kSilenceSeconds * rate_hz_);
  }
  const double now = clock.frames_at(device_.instant_of(static_cast<double>(position_)));
  const double to_go = static_cast<double>(next_frame_ + 1) - now;
  if (!writer_ || std::abs(to_go - 1) > kMaxError) {
    next_frame_ = std::llround(std::ceil(now));
    writer_.emplace(rate_hz_, rate_, timecode_of(next_frame_, rate_));
    const double wait = static_cast<double>(next_frame_) - now;
    return append_silence(wait * rate_hz_ / frames_per_second(rate_));
  }
  const double drift = 1 + 1e-6 * device_.drift_ppm();
  const auto samples = writer_->next(std::clamp(to_go * drift, 1 - kMaxStretch, 1 + kMaxStretch));
  buffer_.insert(buffer_.end(), samples.begin(), samples.end());
  position_ += std::ssize(samples);
  ++next_frame_;
}

}  // namespace v3d::sound
