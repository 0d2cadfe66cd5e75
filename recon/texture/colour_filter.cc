#include "recon/texture/colour_filter.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/core/error.h"

namespace v3d::recon {

void ColourFilter::apply(std::span<uint8_t> colours, std::span<const uint8_t> seen) {
  V3D_CHECK(colours.size() == 3 * seen.size());
  if (shown_.size() != colours.size()) {
    shown_.assign(colours.begin(), colours.end());
    was_seen_.assign(seen.begin(), seen.end());
    return;
  }
  constexpr float kMinStep = 1.0F / 7, kNoise = 6, kChange = 40;
  for (size_t i = 0; i < was_seen_.size(); ++i) {
    const bool is_seen = seen[i] != 0;
    if (!is_seen && was_seen_[i] != 0) {
      for (size_t c = 3 * i; c < 3 * i + 3; ++c) {
        colours[c] = static_cast<uint8_t>(shown_[c] + 0.5F);
      }
      continue;
    }
    float change = 0;
    for (size_t c = 3 * i; c < 3 * i + 3; ++c) {
      change = std::max(change, std::abs(static_cast<float>(colours[c]) - shown_[c]));
    }
    const bool is_first = is_seen && was_seen_[i] == 0;
    const float step =
        is_first ? 1 : std::clamp((change - kNoise) / (kChange - kNoise), kMinStep, 1.0F);
    for (size_t c = 3 * i; c < 3 * i + 3; ++c) {
      shown_[c] += step * (static_cast<float>(colours[c]) - shown_[c]);
      colours[c] = static_cast<uint8_t>(shown_[c] + 0.5F);
    }
    was_seen_[i] = was_seen_[i] != 0 || is_seen;
  }
}

void ColourFilter::apply(std::vector<Rgb8>& colours, std::span<const uint8_t> seen) {
  static_assert(sizeof(Rgb8) == 3);
  if (colours.empty()) return;
  apply(std::span<uint8_t>(reinterpret_cast<uint8_t*>(colours.data()), 3 * colours.size()), seen);
}

}  // namespace v3d::recon
