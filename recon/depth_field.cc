#include "recon/depth_field.h"

#include <algorithm>

#include "recon/vertex_loop.h"

namespace v3d {
namespace {

constexpr int kSmoothingsPerSweep = 4;
/// A best depth at the end of the profile may be the foot of a higher peak beyond.
constexpr float kTrustInEnds = 0.2F;

struct Peak {
  int at = 0;
  float fraction = 0;  ///< of a step beyond
};

/// The highest place of the profile less `coupling` times the squared way from `field`.
Peak find_peak(const DepthProfile& profile, float field, float first, float coupling) {
  const auto value = [&](int k) {
    const float off = first + static_cast<float>(k) - field;
    return profile[k] - coupling * off * off;
  };
  Peak peak;
  float most = value(0);
  for (int k = 1; k < kDepthSteps; ++k) {
    if (const float v = value(k); v > most) most = v, peak.at = k;
  }
  if (peak.at > 0 && peak.at + 1 < kDepthSteps) {
    const float before = value(peak.at - 1), after = value(peak.at + 1);
    const float bend = before - 2 * most + after;
    if (bend < 0) peak.fraction = std::clamp(0.5F * (before - after) / bend, -0.5F, 0.5F);
  }
  return peak;
}

/// How much a pick should count: a high correlation that stands out of its profile.
float weight_of(const DepthProfile& profile, int at) {
  float sum = 0;
  for (const float p : profile) sum += p;
  const float height = profile[at] - sum / kDepthSteps;
  const bool end = at == 0 || at + 1 == kDepthSteps;
  return std::max(0.0F, height) * std::max(0.0F, profile[at]) * (end ? kTrustInEnds : 1.0F);
}

}  // namespace

std::span<const float> DepthField::solve(const Neighbours& neighbours,
                                         std::span<const DepthProfile> profiles,
                                         std::span<const uint8_t> known,
                                         std::span<const OutlinePull> pulls,
                                         const DepthFieldOptions& options) {
  const size_t count = profiles.size();
  field_.assign(count, 0.0F);
  next_.resize(count);
  picks_.resize(count);
  for (int sweep = 0; sweep < options.sweeps; ++sweep) {
    const float strict = static_cast<float>(sweep) / static_cast<float>(options.sweeps - 1);
    for_each_vertex(count, [&](size_t v) {
      Pick pick{pulls[v].weight, pulls[v].sum_m / options.step_m};
      if (known[v]) {
        const Peak peak =
            find_peak(profiles[v], field_[v], options.first, options.coupling * strict);
        const float weight = options.photometric * weight_of(profiles[v], peak.at);
        pick.weight += weight;
        pick.steps += weight * (options.first + static_cast<float>(peak.at) + peak.fraction);
      }
      picks_[v] = pick;
    });
    for (int i = 0; i < kSmoothingsPerSweep; ++i) smooth_once(neighbours, options);
  }
  for_each_vertex(count, [&](size_t v) { field_[v] *= options.step_m; });
  return field_;
}

/// One Jacobi step towards the field that balances picks and neighbours.
void DepthField::smooth_once(const Neighbours& neighbours, const DepthFieldOptions& options) {
  for_each_vertex(field_.size(), [&](size_t v) {
    float around = 0;
    for (const uint32_t n : neighbours.of(v)) around += field_[n];
    around /= static_cast<float>(std::max<size_t>(1, neighbours.of(v).size()));
    const float weight = picks_[v].weight + options.smoothness;
    next_[v] = weight > 0 ? (picks_[v].steps + options.smoothness * around) / weight : 0.0F;
  });
  field_.swap(next_);
}

}  // namespace v3d
