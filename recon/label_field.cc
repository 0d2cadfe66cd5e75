#include "recon/label_field.h"

// Registers of unknown length cannot be members of a struct.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/label_field.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <algorithm>

#include "recon/vertex_loop.h"

HWY_BEFORE_NAMESPACE();
namespace v3d::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Costs = LabelField::Costs;
constexpr int kLabels = LabelField::kLabels;

using Shorts = hn::CappedTag<int16_t, kLabels>;
constexpr size_t kInRegister = hn::MaxLanes(Shorts());

/// Calls work(first label) for each register of labels.
template <class Work>
HWY_INLINE void for_each_register(const Work& work) {
  for (size_t k = 0; k < kLabels; k += kInRegister) work(k);
}

HWY_INLINE void add(const Costs& from, Costs& to) {
  const Shorts shorts;
  for_each_register([&](size_t k) {
    const auto sum = hn::SaturatedAdd(hn::Load(shorts, &to.of[k]), hn::Load(shorts, &from.of[k]));
    hn::Store(sum, shorts, &to.of[k]);
  });
}

/// All that a node hears, and its own costs.
HWY_INLINE Costs belief(const Costs& own, const Costs* heard, size_t count) {
  Costs sum = own;
  for (size_t i = 0; i < count; ++i) add(heard[i], sum);
  return sum;
}

/// Costs with room for labels that do not exist, which cost more than any.
struct Padded {
  static constexpr size_t kRoom = 32;
  alignas(64) int16_t of[kLabels + 2 * kRoom];

  Padded() { std::fill(std::begin(of), std::end(of), int16_t{INT16_MAX}); }
  int16_t* label(size_t k) { return of + kRoom + k; }
};

/// Lets every label be reached from those `far` labels away, for `price`.
HWY_INLINE void reach(size_t far, int16_t price, Padded& costs) {
  const Shorts shorts;
  const auto toll = hn::Set(shorts, price);
  Costs reached;
  for_each_register([&](size_t k) {
    const int16_t* at = costs.label(k);
    const auto aside = hn::Min(hn::LoadU(shorts, at - far), hn::LoadU(shorts, at + far));
    const auto best = hn::Min(hn::Load(shorts, at), hn::SaturatedAdd(aside, toll));
    hn::Store(best, shorts, &reached.of[k]);
  });
  for_each_register(
      [&](size_t k) { hn::Store(hn::Load(shorts, &reached.of[k]), shorts, costs.label(k)); });
}

/// What a node tells along an edge: for each label of the other end the least that its own side
/// then costs, less the least of all; halfway from what it told before, which keeps circles of
/// nodes from swinging.
HWY_INLINE void tell(const Costs& belief, const Costs& heard, int16_t slope, const Costs& before,
                     Padded& costs, Costs& told) {
  const Shorts shorts;
  auto least = hn::Set(shorts, INT16_MAX);
  for_each_register([&](size_t k) {
    // Not what was heard along the same edge.
    const auto rest =
        hn::SaturatedSub(hn::Load(shorts, &belief.of[k]), hn::Load(shorts, &heard.of[k]));
    hn::Store(rest, shorts, costs.label(k));
    least = hn::Min(least, rest);
  });
  least = hn::MinOfLanes(shorts, least);
  static_assert(LabelField::kFarthest == 8, "1 + 2 + 4 labels can be crossed");
  for (const int16_t far : {1, 2, 4}) reach(far, static_cast<int16_t>(far * slope), costs);
  const auto most = hn::Set(shorts, static_cast<int16_t>(LabelField::kFarthest * slope));
  for_each_register([&](size_t k) {
    const auto now = hn::Min(hn::SaturatedSub(hn::Load(shorts, costs.label(k)), least), most);
    const auto mean = hn::ShiftRight<1>(hn::Add(now, hn::Load(shorts, &before.of[k])));
    hn::Store(mean, shorts, &told.of[k]);
  });
}

/// Nodes begin to end - 1 tell all their neighbours.
void tell_all(std::span<const Costs> costs, const uint32_t* first, const uint32_t* answer,
              const Costs* messages, int16_t slope, size_t begin, size_t end, Costs* next) {
  Padded work;
  for (size_t node = begin; node < end; ++node) {
    const Costs sum = belief(costs[node], messages + first[node], first[node + 1] - first[node]);
    for (size_t slot = first[node]; slot < first[node + 1]; ++slot) {
      tell(sum, messages[slot], slope, messages[answer[slot]], work, next[answer[slot]]);
    }
  }
}

uint8_t cheapest(std::span<const Costs> costs, const uint32_t* first, const Costs* messages,
                 size_t node) {
  const Costs sum = belief(costs[node], messages + first[node], first[node + 1] - first[node]);
  return static_cast<uint8_t>(std::min_element(sum.of.begin(), sum.of.end()) - sum.of.begin());
}

}  // namespace
}  // namespace v3d::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d {

HWY_EXPORT(tell_all);
HWY_EXPORT(cheapest);

std::span<const uint8_t> LabelField::solve(std::span<const Costs> costs,
                                           std::span<const Edge> edges,
                                           const LabelFieldOptions& options) {
  connect(costs.size(), edges);
  for (int round = 0; round < options.rounds; ++round) {
    for_each_block<512>(costs.size(), [&](size_t begin, size_t end) {
      HWY_DYNAMIC_DISPATCH(tell_all)
      (costs, first_.data(), answer_.data(), messages_.data(), options.slope, begin, end,
       next_.data());
    });
    messages_.swap(next_);
  }
  labels_.resize(costs.size());
  for_each_vertex(costs.size(), [&](size_t node) {
    labels_[node] = HWY_DYNAMIC_DISPATCH(cheapest)(costs, first_.data(), messages_.data(), node);
  });
  return labels_;
}

void LabelField::connect(size_t nodes, std::span<const Edge> edges) {
  first_.assign(nodes + 1, 0);
  for (const auto& [a, b] : edges) ++first_[a + 1], ++first_[b + 1];
  for (size_t n = 0; n < nodes; ++n) first_[n + 1] += first_[n];
  answer_.resize(2 * edges.size());
  std::vector<uint32_t> free(first_.begin(), first_.end() - 1);
  for (const auto& [a, b] : edges) {
    const uint32_t at_a = free[a]++, at_b = free[b]++;
    answer_[at_a] = at_b;
    answer_[at_b] = at_a;
  }
  messages_.assign(answer_.size(), Costs{});
  next_.resize(answer_.size());
}

}  // namespace v3d
#endif
