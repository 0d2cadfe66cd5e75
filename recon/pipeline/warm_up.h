// A frame set of nothing real, to work on before the first real one.
#pragma once

#include "base/camera_model.h"
#include "base/geometry.h"
#include "recon/pipeline/reconstructor.h"

namespace v3d {

/// A grey ball in the middle of `bounds`, about as large as a person, as the cameras see it. The
/// first frame set costs several times what later ones do, because all memory is fetched from the
/// kernel for it; in a take it would be late, and those behind it, too.
FrameSet warm_up_frame_set(const Rig& rig, const Box& bounds);

}  // namespace v3d
