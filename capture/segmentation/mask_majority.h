// Makes a noisy mask smooth.
#pragma once

#include "base/image/mask.h"

namespace v3d {

/// Each pixel becomes what most of its 3x3 neighbourhood is; beyond the border the mask goes
/// on as it ends. Lines two pixels wide survive.
void take_majority(Mask& mask);

}  // namespace v3d
