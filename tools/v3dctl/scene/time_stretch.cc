#include "v3dctl/scene/time_stretch.h"

#include <SoundTouch.h>

#include <algorithm>

namespace v3d::ctl {
namespace {

constexpr unsigned kChannels = 2;
/// Segments of the output, and the range in which their best position in the input is searched, ms.
constexpr int kSegmentMs = 20;
constexpr double kSearchMs = 10;
constexpr double kMinSearchMs = 3;
constexpr int kOverlapMs = 5;
constexpr double kMinTempo = 0.01, kMaxTempo = 100;

}  // namespace

struct TimeStretch::Impl {
  soundtouch::SoundTouch stretcher;
};

TimeStretch::TimeStretch(int rate_hz, double tempo) : impl_(std::make_unique<Impl>()) {
  soundtouch::SoundTouch& stretcher = impl_->stretcher;
  stretcher.setSampleRate(static_cast<unsigned>(rate_hz));
  stretcher.setChannels(kChannels);
  stretcher.setSetting(SETTING_SEQUENCE_MS, kSegmentMs);
  // An error of the position in the input is an error of 1 / tempo of it in the output.
  const double search_ms = std::clamp(kSearchMs * tempo, kMinSearchMs, kSearchMs);
  stretcher.setSetting(SETTING_SEEKWINDOW_MS, static_cast<int>(search_ms));
  stretcher.setSetting(SETTING_OVERLAP_MS, kOverlapMs);
  stretcher.setTempo(std::clamp(tempo, kMinTempo, kMaxTempo));
}

TimeStretch::~TimeStretch() = default;
TimeStretch::TimeStretch(TimeStretch&&) noexcept = default;
TimeStretch& TimeStretch::operator=(TimeStretch&&) noexcept = default;

double TimeStretch::lead_s(double tempo) { return 0.5e-3 * kSegmentMs * (1 - tempo); }

void TimeStretch::push(std::span<const float> samples) {
  impl_->stretcher.putSamples(samples.data(), static_cast<unsigned>(samples.size()) / kChannels);
}

bool TimeStretch::pop(std::span<float> samples) {
  const auto count = static_cast<unsigned>(samples.size()) / kChannels;
  if (impl_->stretcher.numSamples() < count) return false;
  impl_->stretcher.receiveSamples(samples.data(), count);
  return true;
}

}  // namespace v3d::ctl
