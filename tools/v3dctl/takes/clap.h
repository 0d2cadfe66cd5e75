// The offset between sound and pictures of a take, by a clap.
#pragma once

#include <optional>

#include "take/take.h"
#include "v3dctl/takes/clap_offset.h"

namespace v3d::ctl {

/// Finds the clap in the sound of a take, and the motion that stops within half a second of it in
/// the frames. Empty where the sound has none. Throws InputError for a take whose sound has no map
/// of pulses, and for files that cannot be read.
std::optional<ClapOffset> find_take_clap(const take::TakePaths& paths);

}  // namespace v3d::ctl
