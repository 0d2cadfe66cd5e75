// Workload of the mesh coder benchmarks: consecutive pulses of the simulated performer, as meshes
// at 10 mm.
#pragma once

#include <vector>

#include "base/geometry/mesh.h"
#include "codec/frame_codec.h"
#include "recon/hull/sparse_volume.h"

namespace v3d::bench {

inline constexpr int kPulses = 4;

struct Pulse {
  recon::SparseVolume volume;
  Mesh mesh;
  std::vector<codec::VertexColour> colours;      ///< of the mesh
  std::vector<codec::VertexPosition> positions;  ///< of the deformed mesh; empty for a hull
};

/// Hulls, as with --quality live.
const std::vector<Pulse>& live_pulses();
/// Deformed surfaces, as with --quality high.
const std::vector<Pulse>& high_pulses();

/// Content of the pulse for an encoder. It refers to the pulse and to `volume`, the view of its
/// volume.
codec::FrameContent content_of(const Pulse& pulse, const codec::BrickVolume& volume,
                               int64_t number);
std::vector<uint8_t> encode_pulse(codec::FrameEncoder& encoder, const Pulse& pulse, int64_t number);

/// PSNR over all colour channels, peak 255, in dB.
double psnr_db(const std::vector<codec::VertexColour>& a,
               const std::vector<codec::VertexColour>& b);

}  // namespace v3d::bench
