// The surface as a silhouette, to be held against the mask it came from.
#pragma once

#include <span>
#include <vector>

#include "base/camera_model.h"
#include "base/mask.h"
#include "base/mesh.h"

namespace v3d {

/// Foreground: the pixels of the whole image whose centres any triangle covers. Pure; one thread.
Mask draw_silhouette(const Mesh& mesh, const CameraModel& camera);

/// One mask per camera, cameras in parallel.
std::vector<Mask> draw_silhouettes(const Mesh& mesh, std::span<const CameraModel> cameras);

}  // namespace v3d
