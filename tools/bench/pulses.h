// Pulses of the simulated performer that follow each other, as meshes at 10 mm: what the coders of
// meshes are measured on.
#pragma once

#include <vector>

#include "base/geometry/mesh.h"
#include "codec/frame_codec.h"
#include "recon/hull/sparse_volume.h"

namespace v3d::bench {

inline constexpr int kPulses = 4;

struct Pulse {
  SparseVolume volume;
  Mesh mesh;
  std::vector<VertexColour> colours;      ///< the mesh's
  std::vector<VertexPosition> positions;  ///< the mesh's where it was deformed, else none
};

/// The hull, and the surface of --quality high.
const std::vector<Pulse>& live_pulses();
const std::vector<Pulse>& high_pulses();

/// Borrows from the pulse and from `volume`, its view.
FrameContent content_of(const Pulse& pulse, const BrickVolume& volume, int64_t number);
std::vector<uint8_t> encode_pulse(FrameEncoder& encoder, const Pulse& pulse, int64_t number);

/// Of all channels against 255.
double psnr_db(const std::vector<VertexColour>& a, const std::vector<VertexColour>& b);

}  // namespace v3d::bench
