#include "recon/correlation.h"

// Registers of unknown length cannot be members of a struct.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/correlation.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <cmath>
#include <cstring>
#include <span>

HWY_BEFORE_NAMESPACE();
namespace v3d::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#include "recon/lanes.inc"

// A lane is a depth: no sum goes across lanes, so their number does not matter.
static_assert(kDepthSteps % kLanes == 0);

HWY_INLINE Lanes lanes_at(const float* from) { return Lanes(hn::Load(Floats(), from)); }
HWY_INLINE void put(Lanes value, float* to) { hn::Store(value.v, Floats(), to); }

struct Patch {
  alignas(64) float sample[kMostWindowSide * kMostWindowSide][kLanes];
  alignas(64) float mean[kLanes];
  alignas(64) float inverse_deviation[kLanes];  ///< 1 / sqrt(sum of squared differences)
};

template <int kByte>
HWY_INLINE Lanes byte(hn::Vec<Words> word) {
  const auto value = hn::And(hn::ShiftRight<8 * kByte>(word), hn::Set(Words(), 255));
  return Lanes(hn::ConvertTo(Floats(), hn::BitCast(Ints(), value)));
}

/// Between the pixels of a Luminance; (u, v) must lie in it.
HWY_INLINE Lanes sample(const Luminance& image, Lanes u, Lanes v) {
  const Ints ints;
  const auto x = truncate(u), y = truncate(v);
  const Lanes right = u - Lanes(hn::ConvertTo(Floats(), x));
  const Lanes down = v - Lanes(hn::ConvertTo(Floats(), y));
  const auto index = hn::Add(hn::Mul(y, hn::Set(ints, image.width())), x);
  const auto quad = hn::BitCast(
      Words(), hn::GatherIndex(ints, reinterpret_cast<const int32_t*>(image.quads()), index));
  const Lanes upper_left = byte<0>(quad), lower_left = byte<2>(quad);
  const Lanes upper = upper_left + right * (byte<1>(quad) - upper_left);
  const Lanes lower = lower_left + right * (byte<3>(quad) - lower_left);
  return upper + down * (lower - upper);
}

HWY_INLINE void take(const WindowView& view, int side, float noise, Lanes depth, Patch& patch) {
  const Lanes u_middle = Lanes(view.u) + depth * view.u_out;
  const Lanes v_middle = Lanes(view.v) + depth * view.v_out;
  Lanes sum(0.0F), squares(0.0F);
  float(*to)[kLanes] = patch.sample;
  const int half = side / 2;
  for (int j = -half; j <= half; ++j) {
    for (int i = -half; i <= half; ++i) {
      const auto across = static_cast<float>(i), down = static_cast<float>(j);
      const Lanes value =
          sample(*view.image, u_middle + (across * view.u_across + down * view.u_down),
                 v_middle + (across * view.v_across + down * view.v_down));
      sum = sum + value;
      squares = squares + value * value;
      put(value, *to++);
    }
  }
  const auto count = static_cast<float>(side * side);
  const Lanes mean = sum * (1 / count);
  const Lanes variance(hn::Max((squares - sum * mean).v, hn::Zero(Floats())));
  put(mean, patch.mean);
  put(Lanes(1.0F) / Lanes(hn::Sqrt((variance + count * noise).v)), patch.inverse_deviation);
}

HWY_INLINE Lanes correlation(const Patch& a, const Patch& b, int samples) {
  Lanes sum(0.0F);
  for (int i = 0; i < samples; ++i) sum = sum + lanes_at(a.sample[i]) * lanes_at(b.sample[i]);
  const Lanes covariance =
      sum - static_cast<float>(samples) * (lanes_at(a.mean) * lanes_at(b.mean));
  return covariance * (lanes_at(a.inverse_deviation) * lanes_at(b.inverse_deviation));
}

void correlate_any(const WindowViews& views, const CorrelationOptions& options,
                   DepthProfile& profile) {
  Patch reference, other;
  alignas(64) float steps[kDepthSteps];
  for (int k = 0; k < kDepthSteps; ++k) steps[k] = options.first + static_cast<float>(k);
  const Lanes least(options.robust ? 0.0F : -1.0F);
  for (size_t k = 0; k < kDepthSteps; k += kLanes) {
    const Lanes depth = lanes_at(steps + k);
    take(views.view[0], options.side, options.noise, depth, reference);
    Lanes sum(0.0F);
    for (int c = 1; c < views.count; ++c) {
      take(views.view[c], options.side, options.noise, depth, other);
      const Lanes ncc = correlation(reference, other, options.side * options.side);
      sum = sum + Lanes(hn::Max(ncc.v, least.v));
    }
    const Lanes mean = sum * (1 / static_cast<float>(views.count - 1));
    hn::StoreU(mean.v, Floats(), profile.data() + k);
  }
}

HWY_INLINE Lanes higher(Lanes a, Lanes b) { return Lanes(hn::Max(a.v, b.v)); }
HWY_INLINE Lanes lower(Lanes a, Lanes b) { return Lanes(hn::Min(a.v, b.v)); }

/// Of kLanes depths.
struct Pairs {
  alignas(64) float score[kLanes];
  alignas(64) float best_of[kMostWindowViews][kLanes];  ///< of each view with any other
};

HWY_INLINE void compare_pairs(std::span<const Patch> patches, int samples, Pairs& pairs) {
  for (auto& best : pairs.best_of) put(Lanes(0.0F), best);
  Lanes best(0.0F), second(0.0F);
  for (size_t a = 0; a < patches.size(); ++a) {
    for (size_t b = a + 1; b < patches.size(); ++b) {
      const Lanes ncc = correlation(patches[a], patches[b], samples);
      second = higher(second, lower(best, ncc));
      best = higher(best, ncc);
      for (const size_t c : {a, b}) put(higher(lanes_at(pairs.best_of[c]), ncc), pairs.best_of[c]);
    }
  }
  put(Lanes(0.5F) * (best + second), pairs.score);
}

void correlate_pairs_any(const WindowViews& views, const CorrelationOptions& options, float least,
                         PairAgreement& agreement) {
  std::array<Patch, kMostWindowViews> patches;
  Pairs pairs;
  alignas(64) float steps[kDepthSteps];
  for (int k = 0; k < kDepthSteps; ++k) steps[k] = options.first + static_cast<float>(k);
  for (size_t k = 0; k < kDepthSteps; k += kLanes) {
    for (int c = 0; c < views.count; ++c) {
      take(views.view[c], options.side, options.noise, lanes_at(steps + k), patches[c]);
    }
    compare_pairs(std::span(patches).first(views.count), options.side * options.side, pairs);
    for (size_t lane = 0; lane < kLanes; ++lane) {
      uint32_t agreeing = 0;
      for (int c = 0; c < views.count; ++c) {
        agreeing |= static_cast<uint32_t>(pairs.best_of[c][lane] >= least) << c;
      }
      agreement.score[k + lane] = pairs.score[lane];
      agreement.agreeing[k + lane] = static_cast<uint8_t>(agreeing);
    }
  }
}

}  // namespace
}  // namespace v3d::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d {

HWY_EXPORT(correlate_any);
HWY_EXPORT(correlate_pairs_any);

bool window_fits(const WindowView& view, const CorrelationOptions& options) {
  const int reach = options.side / 2;
  const auto half = static_cast<float>(reach);
  const float last = options.first + kDepthSteps - 1;
  const float u_reach = half * (std::abs(view.u_across) + std::abs(view.u_down));
  const float v_reach = half * (std::abs(view.v_across) + std::abs(view.v_down));
  for (const float depth : {options.first, last}) {
    const float u = view.u + depth * view.u_out, v = view.v + depth * view.v_out;
    // Half a pixel for rounding.
    if (!(u - u_reach > 0.5F && v - v_reach > 0.5F &&
          u + u_reach < static_cast<float>(view.image->width()) - 1.5F &&
          v + v_reach < static_cast<float>(view.image->height()) - 1.5F)) {
      return false;
    }
  }
  return true;
}

void correlate(const WindowViews& views, const CorrelationOptions& options, DepthProfile& profile) {
  HWY_DYNAMIC_DISPATCH(correlate_any)(views, options, profile);
}

void correlate_pairs(const WindowViews& views, const CorrelationOptions& options, float least,
                     PairAgreement& agreement) {
  HWY_DYNAMIC_DISPATCH(correlate_pairs_any)(views, options, least, agreement);
}

}  // namespace v3d
#endif
