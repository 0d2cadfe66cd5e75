#include <algorithm>

#include "base/core/error.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/motion/surface_patches.h"

namespace v3d::recon {
namespace {

constexpr int kIterations = 6;
/// Costs in units of correlation: of one step of difference, and at most.
constexpr float kStepCost = 0.06F, kMaxCost = 0.5F;

/// Replaces values[s] by the minimum over t of values[t] + kStepCost * |s - t| (the sum over both
/// axes), in two passes.
void spread(std::span<float> values, int edge) {
  const auto at = [&](int x, int y) -> float& {
    return values[static_cast<size_t>(y) * static_cast<size_t>(edge) + static_cast<size_t>(x)];
  };
  for (int y = 0; y < edge; ++y) {
    for (int x = 0; x < edge; ++x) {
      float& value = at(x, y);
      if (x > 0) value = std::min(value, at(x - 1, y) + kStepCost);
      if (y > 0) value = std::min(value, at(x, y - 1) + kStepCost);
    }
  }
  for (int y = edge - 1; y >= 0; --y) {
    for (int x = edge - 1; x >= 0; --x) {
      float& value = at(x, y);
      if (x + 1 < edge) value = std::min(value, at(x + 1, y) + kStepCost);
      if (y + 1 < edge) value = std::min(value, at(x, y + 1) + kStepCost);
    }
  }
}

/// Messages along both directions of each pair of neighbours: number 2 k from a to b, 2 k + 1 from
/// b to a.
class Propagation {
 public:
  Propagation(const ShiftCorrelations& correlations, std::span<const PatchNeighbours> neighbours,
              size_t patches)
      : correlations_(correlations),
        neighbours_(neighbours),
        shifts_(correlations.shifts()),
        incoming_(patches),
        messages_(2 * neighbours.size() * shifts_, 0),
        next_(messages_.size(), 0) {
    for (uint32_t k = 0; k < neighbours.size(); ++k) {
      incoming_[neighbours[k].b].push_back(2 * k);
      incoming_[neighbours[k].a].push_back(2 * k + 1);
    }
  }

  void run() {
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      for_each_block<64>(2 * neighbours_.size(), [&](size_t begin, size_t end) {
        std::vector<float> cost(shifts_);
        for (size_t k = begin; k < end; ++k) send(k, cost);
      });
      std::swap(messages_, next_);
    }
  }

  /// The cost of each shift of a patch: of its correlation, and by its neighbours.
  void belief(size_t patch, std::span<float> cost, std::optional<size_t> without = {}) const {
    if (correlations_.is_known(patch)) {
      const std::span<const float> correlation = correlations_.of(patch);
      for (size_t s = 0; s < shifts_; ++s) cost[s] = 1 - correlation[s];
    } else {
      std::fill(cost.begin(), cost.end(), 0.0F);
    }
    for (const size_t k : incoming_[patch]) {
      if (k == without) continue;
      const float* message = &messages_[k * shifts_];
      for (size_t s = 0; s < shifts_; ++s) cost[s] += message[s];
    }
  }

 private:
  void send(size_t k, std::span<float> cost) {
    const PatchNeighbours& pair = neighbours_[k / 2];
    belief(k % 2 == 0 ? pair.a : pair.b, cost, k ^ 1U);
    const float least = *std::min_element(cost.begin(), cost.end());
    for (float& value : cost) value = std::min(value - least, kMaxCost);
    spread(cost, correlations_.edge());
    std::copy(cost.begin(), cost.end(), next_.begin() + static_cast<ptrdiff_t>(k * shifts_));
  }

  const ShiftCorrelations& correlations_;
  const std::span<const PatchNeighbours> neighbours_;
  const size_t shifts_;
  std::vector<std::vector<size_t>> incoming_;
  std::vector<float> messages_, next_;
};

}  // namespace

ShiftCorrelations::ShiftCorrelations(size_t patches, int reach)
    : reach_(reach), values_(patches * shifts(), 0), known_(patches, 0) {
  V3D_CHECK(reach > 0 && reach <= kMaxReach);
}

std::vector<std::optional<PatchShift>> likely_shifts(const ShiftCorrelations& correlations,
                                                     std::span<const PatchNeighbours> neighbours) {
  const size_t patches = correlations.patches();
  Propagation propagation(correlations, neighbours, patches);
  propagation.run();
  std::vector<std::optional<PatchShift>> shifts(patches);
  const int edge = correlations.edge();
  for_each_block<64>(patches, [&](size_t begin, size_t end) {
    std::vector<float> cost(correlations.shifts());
    for (size_t i = begin; i < end; ++i) {
      if (!correlations.is_known(i)) continue;
      propagation.belief(i, cost);
      const auto best = std::min_element(cost.begin(), cost.end()) - cost.begin();
      const int x = static_cast<int>(best) % edge, y = static_cast<int>(best) / edge;
      if (x == 0 || y == 0 || x == edge - 1 || y == edge - 1) continue;
      shifts[i] = PatchShift{x - correlations.reach(), y - correlations.reach(),
                             correlations.of(i)[static_cast<size_t>(best)]};
    }
  });
  return shifts;
}

}  // namespace v3d::recon
