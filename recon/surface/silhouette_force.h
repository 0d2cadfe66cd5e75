// The silhouette preserving force, equation (6) of the paper.
#pragma once

#include <optional>

#include "recon/visibility/surface_camera.h"

namespace v3d {

/// The pixels from which the outline of the mesh, as `camera` sees it, is near enough for a vertex
/// there to be on it, and perhaps a few more. `depth` is of the mesh.
Mask near_outline(const SurfaceCamera& camera, const DepthBuffer& depth);

/// A vertex on an outline is seen from aside: the cosine between its normal and the way to the
/// camera.
inline constexpr float kMaxOutlineFacing = 0.35F;

/// How far (metres along the normal) a vertex on the outline of the mesh, as `camera` sees it, must
/// move for the outline to fall on that of the observed silhouette. Both outlines are looked for
/// along the normal's way in the image, in the pixels that the two pictures consist of, so a mesh
/// that fills its silhouette feels nothing. Empty for a vertex that is not on the outline, and
/// where the observed one is not near. `depth` is of the mesh, `seen` is camera.project(place).
/// Requires a vertex that is seen from aside near_outline(): most are not.
std::optional<float> silhouette_displacement(const SurfaceCamera& camera, const DepthBuffer& depth,
                                             const Eigen::Vector3f& place,
                                             const Eigen::Vector3f& normal,
                                             const SurfaceCamera::Seen& seen);

}  // namespace v3d
