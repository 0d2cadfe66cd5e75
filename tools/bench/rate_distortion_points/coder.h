// Draco and meshoptimizer as mesh coders with a given accuracy.
#pragma once

#include <algorithm>
#include <cstddef>

#include "pulses.h"

namespace v3d::bench {

/// Quantisation. Positions are multiples of `step_m` from `origin`, with an error of at most half a
/// step along each axis. Colour channels have an error of at most half of `colour_step`; 0: no
/// colours.
struct Accuracy {
  Eigen::Vector3d origin;
  double step_m = 0.001;
  int colour_step = 1;
};

/// Number of bytes, and the decoded vertices in the order of the mesh.
struct Coded {
  size_t bytes = 0;
  std::vector<codec::VertexPosition> positions;
  std::vector<codec::VertexColour> colours;
};

/// Conversion of colour channels to coded levels and back.
inline uint8_t level_of(uint8_t channel, int step) {
  return static_cast<uint8_t>((channel + step / 2) / step);
}
inline uint8_t channel_of(uint8_t level, int step) {
  return static_cast<uint8_t>(std::min(255, level * step));
}

/// Edgebreaker connectivity, positions quantised by Draco, colour levels without further loss.
/// `speed` 0 gives the smallest files; 5 is the default.
Coded code_with_draco(const Mesh& mesh, const Accuracy& accuracy, int speed);

/// As in glTF: 16 bits an axis, triangles and vertices in the order that the codecs need. Its
/// documentation recommends a general compressor afterwards, which gets `stream`.
struct MeshoptCoded : Coded {
  std::vector<uint8_t> stream;  ///< the encoded bytes
};
MeshoptCoded code_with_meshopt(const Mesh& mesh, const Accuracy& accuracy);

}  // namespace v3d::bench
