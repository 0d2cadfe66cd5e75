// Joint search for the shifts of surface patches: each patch has a correlation for every shift, and
// neighbouring patches shift alike.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace v3d::recon {

/// A whole number of steps along the two axes of a patch.
struct PatchShift {
  int across = 0, down = 0;
  float correlation = 0;  ///< of the patch at this shift
};

/// Correlations of patches at all shifts up to `reach` steps along each axis.
class ShiftCorrelations {
 public:
  static constexpr int kMaxReach = 8;

  ShiftCorrelations(size_t patches, int reach);

  int reach() const { return reach_; }
  int edge() const { return 2 * reach_ + 1; }
  size_t shifts() const { return static_cast<size_t>(edge()) * static_cast<size_t>(edge()); }

  /// Row by row, from the shift (-reach, -reach).
  std::span<float> of(size_t patch) { return {&values_[patch * shifts()], shifts()}; }
  std::span<const float> of(size_t patch) const { return {&values_[patch * shifts()], shifts()}; }
  size_t patches() const { return known_.size(); }
  void set_known(size_t patch) { known_[patch] = 1; }
  bool is_known(size_t patch) const { return known_[patch] != 0; }

 private:
  int reach_;
  std::vector<float> values_;
  std::vector<uint8_t> known_;
};

/// Two patches whose axes have nearly the same directions.
struct PatchNeighbours {
  uint32_t a = 0, b = 0;
};

/// The most likely shift of each known patch, by min-sum belief propagation with a truncated linear
/// cost of the difference of two neighbours. Empty for unknown patches, and at the border of the
/// search. Works in the caller's TBB arena; independent of thread count.
///
/// Source: Felzenszwalb and Huttenlocher, Efficient belief propagation for early vision, IJCV 2006.
std::vector<std::optional<PatchShift>> likely_shifts(const ShiftCorrelations& correlations,
                                                     std::span<const PatchNeighbours> neighbours);

}  // namespace v3d::recon
