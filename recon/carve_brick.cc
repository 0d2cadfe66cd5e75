#include "recon/carve_brick.h"

namespace v3d {
namespace {

constexpr int kLayer = kBrickEdge * kBrickEdge;

/// One layer of voxels: where each one's pixel is.
struct LayerPixels {
  int32_t x[kLayer];
  int32_t y[kLayer];
  int32_t seen[kLayer];
};

template <Lens kLens>
LayerPixels project_layer(const VoxelCamera& c, BrickCoord at, int z) {
  LayerPixels out;
  for (int n = 0; n < kLayer; ++n) {
    const auto p = camera_point<float>(c, static_cast<float>(kBrickEdge * at.x + n % kBrickEdge),
                                       static_cast<float>(kBrickEdge * at.y + n / kBrickEdge),
                                       static_cast<float>(kBrickEdge * at.z + z));
    const PixelPoint<float> q = pixel_point<kLens>(c, p);
    const bool seen = (p.z > 0) & (q.radius2 <= c.max_radius2) & (q.u >= 0) & (q.v >= 0) &
                      (q.u < c.width) & (q.v < c.height);
    out.seen[n] = seen;
    out.x[n] = static_cast<int32_t>(seen ? q.u : 0.0F);
    out.y[n] = static_cast<int32_t>(seen ? q.v : 0.0F);
  }
  return out;
}

template <Lens kLens>
BrickView view(const VoxelCamera& camera, const MaskPyramid& mask, BrickCoord at,
               const Brick& candidates) {
  BrickView result;
  for (int z = 0; z < kBrickEdge; ++z) {
    if (candidates[z] == 0) continue;
    const LayerPixels pixels = project_layer<kLens>(camera, at, z);
    uint64_t seen = 0;
    uint64_t foreground = 0;
    for (int n = 0; n < kLayer; ++n) {
      const uint32_t word = mask.pixels()[pixels.y[n] * mask.words_per_row() + pixels.x[n] / 32];
      seen |= static_cast<uint64_t>(pixels.seen[n]) << n;
      foreground |= uint64_t{word >> (pixels.x[n] % 32) & 1} << n;
    }
    result.seen[z] = seen & candidates[z];
    result.background[z] = seen & ~foreground & candidates[z];
  }
  return result;
}

}  // namespace

BrickView view_brick(const VoxelCamera& camera, const MaskPyramid& mask, BrickCoord at,
                     const Brick& candidates) {
  switch (camera.lens) {
    case Lens::kPinhole:
      return view<Lens::kPinhole>(camera, mask, at, candidates);
    case Lens::kPolynomial:
      return view<Lens::kPolynomial>(camera, mask, at, candidates);
    default:
      return view<Lens::kFull>(camera, mask, at, candidates);
  }
}

}  // namespace v3d
