// Colours of a mesh for a viewpoint from the views of cameras that a compact frame has.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "codec/frame_codec.h"
#include "recon/texture/texture.h"

namespace v3d::recon {

/// `colours`, one entry for each camera, as views of a compact frame. A vertex at the rim of a
/// silhouette, where the colour may be that of the background, is seen only if no camera sees it
/// elsewhere (Visibility::kFull). Requires the cameras in `rig`.
std::vector<codec::CameraView> camera_views(std::span<const CameraColours> colours, const Rig& rig);

/// View-dependent colours: the mean over the cameras that see a vertex, with the weights of
/// Algorithm 2, equation (7). A vertex that no camera sees keeps its entry of `colours`. Requires
/// views of all vertices.
std::vector<Rgb8> blended_views(std::span<const Rgb8> colours,
                                std::span<const codec::CameraView> views,
                                const ViewDependence& eye);

}  // namespace v3d::recon
