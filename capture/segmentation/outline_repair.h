// Repair of frayed outlines: random missing pixels, where performer and background look alike.
#pragma once

#include "base/image/mask.h"

namespace v3d {

/// True if a silhouette has more than one notch per ten pixels of its outline. A notch is one or
/// two missing pixels, one pixel deep. `raw` is the mask as segmented; `smooth` is the same without
/// specks and holes and defines the outline.
///
/// Clean outlines have up to 2 notches per 100 pixels. Noise of 5 % of all pixels makes 4 to 7
/// (docs/silhouettes.md). Requires masks of equal size. Pure function.
bool is_frayed(const Mask& raw, const Mask& smooth);

/// Fills the notches in `raw` near the outline of `smooth`. A notch here is a run of up to eight
/// background pixels along a row, a column or a diagonal. It has foreground at both ends and along
/// one whole side. A gap between two limbs has foreground along one side only at its end, so it
/// stays open.
///
/// Also fills single background pixels inside, and removes bumps of one or two pixels. The result
/// contains no pixel farther than two pixels from `smooth`. Requires masks of equal size. Pure
/// function.
Mask without_notches(const Mask& raw, const Mask& smooth);

}  // namespace v3d
