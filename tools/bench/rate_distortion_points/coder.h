// Meshes coded by others at a chosen accuracy.
#pragma once

#include <algorithm>
#include <cstddef>

#include "pulses.h"

namespace v3d::bench {

/// How much may be lost. Positions come back to half of `step_m` along each axis, whole steps from
/// `origin`, and channels of colours to half of `colour_step`; a step of 0: no colours.
struct Accuracy {
  Eigen::Vector3d origin;
  double step_m = 0.001;
  int colour_step = 1;
};

/// What it costs, and what came back, in the order of the mesh's vertices.
struct Coded {
  size_t bytes = 0;
  std::vector<VertexPosition> positions;
  std::vector<VertexColour> colours;
};

/// Colours as whole steps, which are what is coded, and back.
inline uint8_t level_of(uint8_t channel, int step) {
  return static_cast<uint8_t>((channel + step / 2) / step);
}
inline uint8_t channel_of(uint8_t level, int step) {
  return static_cast<uint8_t>(std::min(255, level * step));
}

/// Edgebreaker, positions quantised by Draco, levels of colours without further loss. `speed` 0 is
/// the smallest, 5 the default.
Coded code_with_draco(const Mesh& mesh, const Accuracy& accuracy, int speed);

/// As glTF has it: 16 bits an axis, triangles and vertices in the order that the codecs are made
/// for. Its documentation has a general compressor follow: `stream` is for that.
struct MeshoptCoded : Coded {
  std::vector<uint8_t> stream;  ///< the bytes
};
MeshoptCoded code_with_meshopt(const Mesh& mesh, const Accuracy& accuracy);

}  // namespace v3d::bench
