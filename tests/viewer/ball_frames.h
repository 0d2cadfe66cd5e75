// Frames of a ball of one colour, one metre above the floor, for the browser tests.
#pragma once

#include <cstdint>

#include "tests/codec/scene.h"

namespace v3d {

/// The frame of `pulse`, with all vertices in `colour`. `scene` must be that of a ball; the result
/// borrows from it. Changes the colours of `scene`.
inline FrameContent ball_frame(Scene& scene, int64_t pulse, VertexColour colour) {
  scene.colours.assign(scene.mesh.vertices.size(), colour);
  FrameContent content = scene.content(pulse);
  const double half = 25 * scene.volume.grid().voxel_m;
  content.facts.origin = {-half, -half, 1 - half};
  return content;
}

}  // namespace v3d
