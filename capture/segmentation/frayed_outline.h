// Outlines that lost pixels at random, as where the performer has nearly the background's colour.
#pragma once

#include "base/image/mask.h"

namespace v3d {

/// Whether at every tenth place or more of its outline a silhouette has a notch: one or two pixels
/// missing, one pixel deep. `raw` is the mask as it was found, `smooth` the same without specks and
/// holes: it says where the outline is. Requires equal sizes. Clean outlines have one at up to
/// 2 places of a hundred, noise of 5 % of all pixels makes 4 to 7 (docs/silhouettes.md). Pure.
bool is_frayed(const Mask& raw, const Mask& smooth);

/// Fills the notches in `raw` near the outline of `smooth`: runs of background of up to eight
/// pixels, along a row, a column or a diagonal, with foreground at both ends and on one side all
/// along. A gap between two limbs has foreground on one side only where it ends. Single pixels of
/// background inside go, and what of the outside sticks out by a pixel or two. What is farther than
/// two pixels from `smooth` is left out. Requires equal sizes. Pure.
Mask without_notches(const Mask& raw, const Mask& smooth);

}  // namespace v3d
