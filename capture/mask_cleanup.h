// Makes a noisy mask clean. Pure; works on whole words.
#pragma once

#include "base/mask.h"

namespace v3d {

/// Each pixel becomes what most of its 3x3 neighbourhood is; beyond the border the mask goes
/// on as it ends. Lines two pixels wide survive.
void take_majority(Mask& mask);

/// Clears connected pieces of foreground (eight neighbours) of fewer than `min_area` pixels, and
/// fills pieces of background (four neighbours) of fewer than `max_hole` pixels that do not touch
/// the border.
void drop_small_pieces(Mask& mask, int min_area);
void fill_small_holes(Mask& mask, int max_hole);

}  // namespace v3d
