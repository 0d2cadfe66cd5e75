#include "recon/surface/displacement_field.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/surface/displacement_field.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "recon/mesh/mesh_neighbours.h"

HWY_BEFORE_NAMESPACE();
namespace v3d::recon::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#include "recon/simd_float.inc"

using Values = DisplacementField::Values;

// Each lane is a vertex. No operation crosses lanes, so the number of lanes has no influence.
constexpr size_t kWidth = NeighbourRows::kWidth;
static_assert(kWidth % kLanes == 0);

/// Weight of a best depth at the end of the profile, where a higher peak may lie beyond the end.
constexpr float kEndWeight = 0.2F;

HWY_INLINE Lanes get(const Values& values, size_t lane) {
  return Lanes(hn::Load(Floats(), &values.of[lane]));
}
HWY_INLINE void put(Lanes lanes, Values& values, size_t lane) {
  hn::Store(lanes.v, Floats(), &values.of[lane]);
}
HWY_INLINE Lanes either(hn::Mask<Floats> condition, Lanes yes, Lanes no) {
  return Lanes(hn::IfThenElse(condition, yes.v, no.v));
}
HWY_INLINE Lanes positive(Lanes a) { return Lanes(hn::Max(a.v, hn::Zero(Floats()))); }

/// Maximum of the profile minus `coupling` times the squared distance from the field.
struct Peak {
  Lanes at;  ///< index of the depth
  Lanes value, before,
      after;          ///< value there, one step before and one after, if these exist
  Lanes correlation;  ///< of the profile itself
};

HWY_INLINE Peak find_peak(const DisplacementField::DataTerms& terms, size_t lane, Lanes field,
                          float first, Lanes coupling) {
  const auto value_at = [&](int k, Lanes profile) {
    const Lanes off = Lanes(first + static_cast<float>(k)) - field;
    return profile - coupling * off * off;
  };
  const Lanes zero(0.0F), correlation = get(terms.profile[0], lane);
  Lanes value = value_at(0, correlation);
  Peak peak{zero, value, zero, zero, correlation};
  auto higher = hn::FirstN(Floats(), kLanes);
  for (int k = 1; k < kDepthSteps; ++k) {
    const Lanes profile = get(terms.profile[k], lane), before = value;
    value = value_at(k, profile);
    peak.after = either(higher, value, peak.after);
    higher = hn::Gt(value.v, peak.value.v);
    peak.value = either(higher, value, peak.value);
    peak.before = either(higher, before, peak.before);
    peak.at = either(higher, Lanes(static_cast<float>(k)), peak.at);
    peak.correlation = either(higher, profile, peak.correlation);
  }
  return peak;
}

/// Targets of the peaks, refined by a parabola. The weight is large for a high correlation that
/// exceeds the mean of its profile.
HWY_INLINE void pick_targets(const DisplacementField::DataTerms& terms, size_t lane, Lanes field,
                             const DisplacementFieldOptions& options, Lanes coupling,
                             DisplacementField::Targets& targets) {
  const Floats floats;
  const Peak peak = find_peak(terms, lane, field, options.first, coupling);
  const auto inside = hn::And(hn::Gt(peak.at.v, hn::Zero(floats)),
                              hn::Lt(peak.at.v, hn::Set(floats, kDepthSteps - 1)));
  const Lanes bend = peak.before - Lanes(2.0F) * peak.value + peak.after;
  const auto bends = hn::And(inside, hn::Lt(bend.v, hn::Zero(floats)));
  const Lanes top = Lanes(0.5F) * (peak.before - peak.after) / either(bends, bend, Lanes(1.0F));
  const Lanes kept(hn::Clamp(top.v, hn::Set(floats, -0.5F), hn::Set(floats, 0.5F)));
  const Lanes fraction(hn::IfThenElseZero(bends, kept.v));

  const Lanes height = peak.correlation - get(terms.mean, lane);
  const Lanes end_weight = either(inside, Lanes(1.0F), Lanes(kEndWeight));
  const Lanes weight =
      Lanes(options.photometric) * (positive(height) * positive(peak.correlation) * end_weight);
  const Lanes depth = Lanes(options.first) + peak.at + fraction;
  put(get(terms.pull_weight, lane) + weight, targets.weight, lane);
  put(get(terms.pull_steps, lane) + weight * depth, targets.steps, lane);
}

void pick_any(std::span<const DisplacementField::DataTerms> terms, const float* field,
              const DisplacementFieldOptions& options, float coupling,
              DisplacementField::Targets* targets) {
  for (size_t group = 0; group < terms.size(); ++group) {
    for (size_t lane = 0; lane < kWidth; lane += kLanes) {
      const Lanes at(hn::LoadU(Floats(), field + group * kWidth + lane));
      pick_targets(terms[group], lane, at, options, Lanes(coupling), targets[group]);
    }
  }
}

HWY_INLINE Lanes smooth_lanes(const NeighbourRows& neighbours, size_t group, size_t lane,
                              const DisplacementField::Targets& targets, Lanes smoothness,
                              const float* field) {
  const Floats floats;
  Lanes around(0.0F);
  for (const NeighbourRows::Row& row : neighbours.rows(group)) {
    const auto vertex = hn::Load(Ints(), &row.vertex[lane]);
    around = around + Lanes(hn::GatherIndex(floats, field, vertex));
  }
  const Lanes count = get(neighbours.counts(group), lane);
  around = around / Lanes(hn::Max(count.v, hn::Set(floats, 1.0F)));
  const Lanes weight = get(targets.weight, lane) + smoothness;
  const auto drawn = hn::Gt(weight.v, hn::Zero(floats));
  const Lanes sum = get(targets.steps, lane) + smoothness * around;
  return Lanes(hn::IfThenElseZero(drawn, (sum / either(drawn, weight, Lanes(1.0F))).v));
}

/// One Jacobi step towards the field that balances picks and neighbours.
void smooth_any(const NeighbourRows& neighbours, size_t begin, size_t end,
                const std::vector<DisplacementField::Targets>& targets, float smoothness,
                const float* field, float* next) {
  for (size_t group = begin; group < end; ++group) {
    for (size_t lane = 0; lane < kWidth; lane += kLanes) {
      const Lanes value =
          smooth_lanes(neighbours, group, lane, targets[group], Lanes(smoothness), field);
      hn::StoreU(value.v, Floats(), next + group * kWidth + lane);
    }
  }
}

}  // namespace
}  // namespace v3d::recon::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::recon {
namespace {

constexpr size_t kWidth = NeighbourRows::kWidth;
constexpr int kSmoothingsPerSweep = 4;

constexpr size_t kGroupsAtATime = 32;

}  // namespace

HWY_EXPORT(pick_any);
HWY_EXPORT(smooth_any);

std::span<const float> DisplacementField::solve(const NeighbourRows& neighbours,
                                                std::span<const DepthProfile> profiles,
                                                std::span<const uint8_t> known,
                                                std::span<const OutlinePull> pulls,
                                                const DisplacementFieldOptions& options) {
  const size_t groups = neighbours.groups();
  terms_.resize(groups);
  targets_.resize(groups);
  gather_terms(profiles, known, pulls, options.step_m);
  field_.assign(neighbours.vertices() + 1, 0.0F);
  next_.assign(neighbours.vertices() + 1, 0.0F);
  for (int sweep = 0; sweep < options.sweeps; ++sweep) {
    const float strict = static_cast<float>(sweep) / static_cast<float>(options.sweeps - 1);
    for_each_block<kGroupsAtATime>(groups, [&](size_t begin, size_t end) {
      HWY_DYNAMIC_DISPATCH(pick_any)
      (std::span(terms_).subspan(begin, end - begin), &field_[begin * kWidth], options,
       options.coupling * strict, &targets_[begin]);
    });
    for (int i = 0; i < kSmoothingsPerSweep; ++i) {
      for_each_block<kGroupsAtATime>(groups, [&](size_t begin, size_t end) {
        HWY_DYNAMIC_DISPATCH(smooth_any)
        (neighbours, begin, end, targets_, options.smoothness, field_.data(), next_.data());
      });
      field_.swap(next_);
    }
  }
  for_each_vertex(profiles.size(), [&](size_t v) { field_[v] *= options.step_m; });
  return std::span(field_).first(profiles.size());
}

void DisplacementField::gather_terms(std::span<const DepthProfile> profiles,
                                     std::span<const uint8_t> known,
                                     std::span<const OutlinePull> pulls, float step_m) {
  const auto gather = [&](size_t group) {
    DataTerms& terms = terms_[group] = DataTerms{};
    const size_t end = std::min(profiles.size(), (group + 1) * kWidth);
    for (size_t v = group * kWidth; v < end; ++v) {
      const size_t lane = v % kWidth;
      terms.pull_weight.of[lane] = pulls[v].weight;
      terms.pull_steps.of[lane] = pulls[v].sum_m / step_m;
      if (!known[v]) continue;
      float sum = 0;
      for (int k = 0; k < kDepthSteps; ++k) {
        terms.profile[k].of[lane] = profiles[v][k];
        sum += profiles[v][k];
      }
      terms.mean.of[lane] = sum / kDepthSteps;
    }
  };
  for_each_block<kGroupsAtATime>(terms_.size(), [&](size_t begin, size_t end) {
    for (size_t group = begin; group < end; ++group) gather(group);
  });
}

}  // namespace v3d::recon
#endif
