// One of 32 labels for every node of a graph: cheap for the node itself, and not far from those of
// its neighbours.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace v3d {

struct BeliefPropagationOptions {
  uint8_t slope = 31;  ///< what neighbours pay for each label between theirs; at most 31
  int rounds = 10;     ///< in which every node hears of nodes one edge farther away
};

/// Min-sum belief propagation with truncated linear costs of edges (Felzenszwalb and Huttenlocher,
/// Efficient belief propagation for early vision, IJCV 2006). Labels of neighbours that are
/// kFarthest or more apart cost no more than kFarthest steps: a surface may break. Costs are whole
/// numbers, so the result depends neither on the number of threads nor on the instruction set.
/// Keeps its memory. Works in the caller's TBB arena.
class BeliefPropagation {
 public:
  static constexpr int kLabels = 32;
  static constexpr int kMaxStep = 8;
  /// What each label costs a node, at most kMaxCost.
  struct alignas(64) Costs {
    std::array<int16_t, kLabels> of{};
  };
  static constexpr int16_t kMaxCost = 512;
  /// What a node hears along an edge: costs of its labels, as far as they are not the same for all.
  struct alignas(32) Message {
    std::array<uint8_t, kLabels> of{};
  };
  using Edge = std::pair<uint32_t, uint32_t>;

  /// `edges`: each once, in any order. A label per node; lives until the next call.
  std::span<const uint8_t> solve(std::span<const Costs> costs, std::span<const Edge> edges,
                                 const BeliefPropagationOptions& options);

 private:
  void connect(size_t nodes, std::span<const Edge> edges);

  std::vector<uint32_t> first_;           ///< of each node, in messages_; and the end
  std::vector<uint32_t> reverse_;         ///< where the other end of the edge hears of this one
  std::vector<Message> messages_, next_;  ///< what a node hears, edge by edge
  std::vector<uint8_t> labels_;
};

}  // namespace v3d
