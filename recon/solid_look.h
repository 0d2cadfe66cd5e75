// Whether a piece of an image shows the surface that it is said to show, by its colours.
#pragma once

#include <span>

#include "base/camera_model.h"
#include "base/frame.h"
#include "base/mask.h"
#include "base/mesh.h"

namespace v3d {

/// True when most places of `surface` that `camera` sees within `piece` have, in its image, the
/// colours that cameras beside it see at the same places, and those agree with each other. What
/// lies behind a hollow does not. False where colours are lacking. frames: one per camera of the
/// rig, or null; `voxel_m`: how well the surface is known. Pure.
bool looks_solid(const Rig& rig, std::span<const Frame* const> frames, size_t camera,
                 const Mask& piece, const Mesh& surface, double voxel_m);

}  // namespace v3d
