#include "recon/surface/belief_propagation.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/surface/belief_propagation.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <algorithm>

#include "base/core/error.h"
#include "recon/mesh/mesh_neighbours.h"

HWY_BEFORE_NAMESPACE();
namespace v3d::recon::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Costs = BeliefPropagation::Costs;
using Message = BeliefPropagation::Message;
constexpr int kLabels = BeliefPropagation::kLabels;

using Shorts = hn::CappedTag<int16_t, kLabels / 2>;
using BytesOfShorts = hn::Rebind<uint8_t, Shorts>;
constexpr size_t kInRegister = hn::MaxLanes(Shorts());

/// Calls work(first label) for each register of labels.
template <class Work>
HWY_INLINE void for_each_register(const Work& work) {
  for (size_t k = 0; k < kLabels; k += kInRegister) work(k);
}

/// Costs of an incoming message, from label `k` on.
HWY_INLINE hn::Vec<Shorts> incoming_at(const Message& incoming, size_t k) {
  return hn::PromoteTo(Shorts(), hn::Load(BytesOfShorts(), &incoming.of[k]));
}

/// Belief of a node: its own costs plus all incoming messages.
HWY_INLINE Costs belief(const Costs& own, const Message* incoming, size_t count) {
  const Shorts shorts;
  Costs sum;
  for_each_register([&](size_t k) {
    auto lanes = hn::Load(shorts, &own.of[k]);
    for (size_t i = 0; i < count; ++i) lanes = hn::SaturatedAdd(lanes, incoming_at(incoming[i], k));
    hn::Store(lanes, shorts, &sum.of[k]);
  });
  return sum;
}

/// One byte for each label.
using Bytes = hn::CappedTag<uint8_t, kLabels / 2>;
constexpr int kInBytes = static_cast<int>(hn::MaxLanes(Bytes()));
constexpr int kRegisters = kLabels / kInBytes;
struct Labels {
  // With NEON a register has a constructor. Only a constructor that is written here can inline it:
  // GCC compiles a generated one without the instruction set of this namespace.
  HWY_INLINE Labels() {}  // NOLINT(modernize-use-equals-default)
  hn::Vec<Bytes> of[kRegisters];
};

HWY_INLINE Labels load(const Message& message) {
  Labels labels;
  for (int r = 0; r < kRegisters; ++r) {
    labels.of[r] = hn::Load(Bytes(), &message.of[kInBytes * r]);
  }
  return labels;
}

/// Belief without one incoming message, minus its minimum.
HWY_INLINE Labels belief_without(const Costs& belief, const Message& incoming) {
  const Shorts shorts;
  Costs remaining;
  auto min_cost = hn::Set(shorts, INT16_MAX);
  for_each_register([&](size_t k) {
    const auto lanes = hn::Sub(hn::Load(shorts, &belief.of[k]), incoming_at(incoming, k));
    hn::Store(lanes, shorts, &remaining.of[k]);
    min_cost = hn::Min(min_cost, lanes);
  });
  min_cost = hn::MinOfLanes(shorts, min_cost);
  Message message;
  for_each_register([&](size_t k) {
    const auto lanes = hn::Sub(hn::Load(shorts, &remaining.of[k]), min_cost);
    hn::Store(hn::DemoteTo(BytesOfShorts(), lanes), BytesOfShorts(), &message.of[k]);
  });
  return load(message);
}

/// Costs shifted by kFar labels (kFar < 0: to the left). Labels beyond the end get `none`.
template <int kFar>
HWY_INLINE hn::Vec<Bytes> shifted(const Labels& labels, int of, hn::Vec<Bytes> none) {
  const auto at = [&](int r) { return r >= 0 && r < kRegisters ? labels.of[r] : none; };
#if HWY_TARGET == HWY_SCALAR
  return at(of - kFar);
#else
  if constexpr (kFar < 0) {
    return hn::CombineShiftRightBytes<-kFar>(Bytes(), at(of + 1), at(of));
  } else {
    return hn::CombineShiftRightBytes<kInBytes - kFar>(Bytes(), at(of), at(of - 1));
  }
#endif
}

/// Reduces the cost of every label to that of the labels kFar away plus `price`.
template <int kFar>
HWY_INLINE Labels reach(uint8_t price, const Labels& costs) {
  const Bytes bytes;
  const auto penalty = hn::Set(bytes, price), none = hn::Set(bytes, UINT8_MAX);
  Labels reached;
  for (int r = 0; r < kRegisters; ++r) {
    const auto neighbour = hn::Min(shifted<kFar>(costs, r, none), shifted<-kFar>(costs, r, none));
    reached.of[r] = hn::Min(costs.of[r], hn::SaturatedAdd(neighbour, penalty));
  }
  return reached;
}

/// Outgoing message along an edge: for each label of the receiver the smallest cost of the sender,
/// minus the minimum. The mean with the previous message damps oscillations in loops. Halves are
/// rounded up and down alternately, because otherwise they would never vanish.
HWY_INLINE void send(const Costs& belief, const Message& incoming, uint8_t slope, int iteration,
                     const Message& before, Message& sent) {
  const Bytes bytes;
  static_assert(BeliefPropagation::kMaxStep == 8, "1 + 2 + 4 labels can be crossed");
  Labels now = belief_without(belief, incoming);
  now = reach<1>(slope, now);
  now = reach<2>(static_cast<uint8_t>(2 * slope), now);
  now = reach<4>(static_cast<uint8_t>(4 * slope), now);
  const auto max_cost = hn::Set(bytes, static_cast<uint8_t>(BeliefPropagation::kMaxStep * slope));
  const auto turned = hn::Set(bytes, iteration % 2 == 0 ? 0 : UINT8_MAX);
  const Labels was = load(before);
  for (int r = 0; r < kRegisters; ++r) {
    // AverageRound() rounds up; on complemented values that rounds down.
    const auto mean =
        hn::AverageRound(hn::Xor(hn::Min(now.of[r], max_cost), turned), hn::Xor(was.of[r], turned));
    hn::Store(hn::Xor(mean, turned), bytes, &sent.of[kInBytes * r]);
  }
}

/// Sends the messages of nodes begin to end - 1.
void send_all(std::span<const Costs> costs, const uint32_t* first, const uint32_t* reverse,
              const Message* messages, uint8_t slope, int iteration, size_t begin, size_t end,
              Message* next) {
  for (size_t node = begin; node < end; ++node) {
    const Costs sum = belief(costs[node], messages + first[node], first[node + 1] - first[node]);
    for (size_t slot = first[node]; slot < first[node + 1]; ++slot) {
      send(sum, messages[slot], slope, iteration, messages[reverse[slot]], next[reverse[slot]]);
    }
  }
}

uint8_t best_label(std::span<const Costs> costs, const uint32_t* first, const Message* messages,
                   size_t node) {
  const Costs sum = belief(costs[node], messages + first[node], first[node + 1] - first[node]);
  return static_cast<uint8_t>(std::min_element(sum.of.begin(), sum.of.end()) - sum.of.begin());
}

}  // namespace
}  // namespace v3d::recon::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::recon {

HWY_EXPORT(send_all);
HWY_EXPORT(best_label);

std::span<const uint8_t> BeliefPropagation::solve(std::span<const Costs> costs,
                                                  std::span<const Edge> edges,
                                                  const BeliefPropagationOptions& options) {
  V3D_CHECK(kMaxStep * options.slope <= UINT8_MAX);
  connect(costs.size(), edges);
  for (int iteration = 0; iteration < options.iterations; ++iteration) {
    for_each_block<512>(costs.size(), [&](size_t begin, size_t end) {
      HWY_DYNAMIC_DISPATCH(send_all)
      (costs, first_.data(), reverse_.data(), messages_.data(), options.slope, iteration, begin,
       end, next_.data());
    });
    messages_.swap(next_);
  }
  labels_.resize(costs.size());
  for_each_vertex(costs.size(), [&](size_t node) {
    labels_[node] = HWY_DYNAMIC_DISPATCH(best_label)(costs, first_.data(), messages_.data(), node);
  });
  return labels_;
}

void BeliefPropagation::connect(size_t nodes, std::span<const Edge> edges) {
  first_.assign(nodes + 1, 0);
  for (const auto& [a, b] : edges) ++first_[a + 1], ++first_[b + 1];
  for (size_t n = 0; n < nodes; ++n) first_[n + 1] += first_[n];
  reverse_.resize(2 * edges.size());
  std::vector<uint32_t> free(first_.begin(), first_.end() - 1);
  for (const auto& [a, b] : edges) {
    const uint32_t at_a = free[a]++, at_b = free[b]++;
    reverse_[at_a] = at_b;
    reverse_[at_b] = at_a;
  }
  messages_.assign(reverse_.size(), Message{});
  next_.resize(reverse_.size());
}

}  // namespace v3d::recon
#endif
