// The template windows of a vertex: which cameras look at it, and where the window falls in their
// pictures.
#pragma once

#include <span>

#include "recon/correlation.h"
#include "recon/surface_camera.h"

namespace v3d {

/// A window tangent to the surface.
struct TemplateWindow {
  Eigen::Vector3f place, normal;  ///< world; metres, unit length
  float spacing_m = 0;            ///< between two samples
  float step_m = 0;               ///< between two depths of a profile
};

struct WindowChoice {
  int level = 0;              ///< of SurfaceCamera::picture()
  int most_views = 6;         ///< at most kMostWindowViews
  float least_facing = 0.3F;  ///< cosine between the normal and the way to a camera
  float tolerance_m = 0;      ///< see SurfaceCamera::sees(); grows with the slant
};

/// The cameras that see the window's middle, those that it faces most first: the paper's C_v, c_m
/// at the front. `depths` are of the mesh, one per camera. A camera in which part of the window
/// would leave the picture is left out. None where the window's corners leave the silhouette of the
/// first, at an outline or on what is slenderer than the window: the background would be compared.
WindowViews views_of(const TemplateWindow& window, std::span<const SurfaceCamera> cameras,
                     std::span<const DepthBuffer> depths, const WindowChoice& choice,
                     const CorrelationOptions& correlation);

}  // namespace v3d
