// Silhouette force: displacement of outline vertices to the observed outline. Source: equation (6)
// of the paper (silhouette preserving force).
#pragma once

#include <optional>

#include "recon/visibility/surface_camera.h"

namespace v3d {

/// The pixels of `camera` near the outline of the mesh. They include all pixels where a vertex may
/// lie on the outline. `depth` is the depth buffer of the mesh.
Mask near_outline(const SurfaceCamera& camera, const DepthBuffer& depth);

/// Largest cosine between the normal of a vertex on an outline and the direction to the camera.
inline constexpr float kMaxOutlineFacing = 0.35F;

/// How far a vertex on the outline of the mesh must move along its normal, metres, so that the
/// outline falls on that of the observed silhouette.
///
/// Both outlines are searched along the projected normal, in the pixels of depth buffer and mask.
/// So a mesh that fills its silhouette has displacement 0. Empty for a vertex off the outline, and
/// where the observed outline is not near.
///
/// `depth` is the depth buffer of the mesh, `seen` is camera.project(place). Requires a grazing
/// vertex (grazing_vertices()) inside near_outline().
std::optional<float> silhouette_displacement(const SurfaceCamera& camera, const DepthBuffer& depth,
                                             const Eigen::Vector3f& place,
                                             const Eigen::Vector3f& normal,
                                             const SurfaceCamera::Seen& seen);

}  // namespace v3d
