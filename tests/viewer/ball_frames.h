// Frames of a ball of one colour, one metre above the floor, for the browser tests.
#pragma once

#include <cstdint>

#include "tests/codec/coded_scene.h"

namespace v3d {

/// The frame of `pulse`, with all vertices in `colour`. `scene` must be that of a ball; the result
/// borrows from it. Changes the colours of `scene`.
inline codec::FrameContent ball_frame(codec::Scene& scene, int64_t pulse,
                                      codec::VertexColour colour) {
  scene.colours.assign(scene.mesh.vertices.size(), colour);
  codec::FrameContent content = scene.content(pulse);
  const double half = 25 * scene.volume.grid().voxel_m;
  content.metadata.origin = {-half, -half, 1 - half};
  return content;
}

}  // namespace v3d
