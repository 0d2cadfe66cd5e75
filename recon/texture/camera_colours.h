// The colours of a mesh one camera at a time, before they are blended: what is needed to colour it
// for any viewpoint elsewhere.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "recon/texture/texture.h"

namespace v3d {

/// How a camera sees a vertex: as in colour_vertices().
enum class Visibility : uint8_t {
  kNone = 0,
  kRim = 128,  ///< at its silhouette's rim: the colour may be the background's
  kFull = 255
};

struct CameraColours {
  std::string camera;
  /// Red, green, blue as in the images (corrected by the camera's ColourResponse), and a
  /// Visibility; all 0 for a vertex that the camera does not see. One for each vertex.
  std::vector<std::array<uint8_t, 4>> vertices;
};

/// In the order of the cameras' names; a camera whose frame has no pixels sees nothing.
/// options.view and options.fill_passes do not matter. Deterministic for any number of threads.
std::vector<CameraColours> camera_colours(const Mesh& mesh, std::span<const TextureCamera> cameras,
                                          const TextureOptions& options);

}  // namespace v3d
