// Ways to spoil a silhouette on purpose.
#pragma once

#include <random>
#include <span>

#include "base/image/mask.h"

namespace v3d::bench {

/// `spoil` changes a mask; what it does is a function of the mask and of `random`.
struct Damage {
  const char* name;
  /// Whether the masks of all cameras are spoilt, or of one in four (one at least).
  bool everywhere;
  void (*spoil)(Mask& mask, std::mt19937& random);
};

/// Small noise, as a bad segmentation makes it, then faults as people and machines make them.
std::span<const Damage> all_damages();

}  // namespace v3d::bench
