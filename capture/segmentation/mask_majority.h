// 3x3 majority filter of a mask.
#pragma once

#include "base/image/mask.h"

namespace v3d {

/// Sets each pixel to the majority of its 3x3 neighbourhood. Border pixels are repeated outside the
/// mask. Lines two pixels wide are kept.
void take_majority(Mask& mask);

}  // namespace v3d
