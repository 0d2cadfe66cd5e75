// The colours of a mesh in each camera, before blending. A renderer elsewhere needs them for
// view-dependent texture.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "recon/texture/texture.h"

namespace v3d {

/// Visibility of a vertex in a camera, as in colour_vertices().
enum class Visibility : uint8_t {
  kNone = 0,
  kRim = 128,  ///< at the rim of the silhouette: the colour may contain background
  kFull = 255
};

struct CameraColours {
  std::string camera;
  /// One entry per vertex: red, green, blue, corrected by the ColourResponse, and a Visibility. All
  /// 0 for a vertex that the camera does not see.
  std::vector<std::array<uint8_t, 4>> vertices;
};

/// One entry per camera, sorted by name. A camera whose frame has no pixels sees nothing.
/// options.view and options.fill_passes are ignored. Deterministic: independent of thread count.
std::vector<CameraColours> camera_colours(const Mesh& mesh, std::span<const TextureCamera> cameras,
                                          const TextureOptions& options);

}  // namespace v3d
