// Belief propagation: chooses one of 32 labels for every node of a graph, with a low cost for the
// node and small steps between neighbours.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace v3d::recon {

struct BeliefPropagationOptions {
  uint8_t slope = 31;   ///< cost of one label of difference between neighbours; at most 31
  int iterations = 10;  ///< information travels one edge in each
};

/// Min-sum belief propagation with truncated linear edge costs: labels that differ by kMaxStep or
/// more cost the same, so a surface may have steps.
///
/// Costs are integers, so the result depends neither on thread count nor on instruction set. Keeps
/// its memory. One caller at a time; works in the caller's TBB arena.
///
/// Source: Felzenszwalb and Huttenlocher, Efficient belief propagation for early vision, IJCV 2006.
class BeliefPropagation {
 public:
  static constexpr int kLabels = 32;
  static constexpr int kMaxStep = 8;
  /// Cost of each label for one node, at most kMaxCost.
  struct alignas(64) Costs {
    std::array<int16_t, kLabels> of{};
  };
  static constexpr int16_t kMaxCost = 512;
  /// Message along one directed edge: the cost of each label of the receiver, less the smallest of
  /// them.
  struct alignas(32) Message {
    std::array<uint8_t, kLabels> of{};
  };
  using Edge = std::pair<uint32_t, uint32_t>;

  /// One label per node. `edges` holds each edge once, in any order. The result is valid until the
  /// next call.
  std::span<const uint8_t> solve(std::span<const Costs> costs, std::span<const Edge> edges,
                                 const BeliefPropagationOptions& options);

 private:
  void connect(size_t nodes, std::span<const Edge> edges);

  std::vector<uint32_t> first_;           ///< index of each node's first message; and the end
  std::vector<uint32_t> reverse_;         ///< index of the message in the other direction
  std::vector<Message> messages_, next_;  ///< incoming messages, edge by edge
  std::vector<uint8_t> labels_;
};

}  // namespace v3d::recon
