// Kinds of artificial damage to silhouettes.
#pragma once

#include <random>
#include <span>

#include "base/image/mask.h"

namespace v3d::bench {

/// One kind of damage. `apply` changes a mask; the result depends only on the mask and `random`.
struct Damage {
  const char* name;
  /// True: the masks of all cameras are damaged. False: of one camera in four, at least one.
  bool everywhere;
  void (*apply)(Mask& mask, std::mt19937& random);
};

/// All kinds: first small noise of a bad segmentation, then large faults of people and equipment.
std::span<const Damage> all_damages();

}  // namespace v3d::bench
