#include "recon/surface/silhouette_coverage.h"

#include <tbb/parallel_for.h>

#include <array>
#include <bit>
#include <cmath>

#include "base/image/mask_morphology.h"
#include "recon/visibility/vertex_visibility.h"

namespace v3d {
namespace {

/// Pixels by which surfaces of voxels may miss the outline.
constexpr int kRim = 1;

/// Voxels of a brick: their numbers and positions.
struct VoxelBlock {
  std::array<uint16_t, PointBlock::kCapacity> number;
  PointBlock places;
};

/// Calls work(VoxelBlock) for all voxels, in blocks.
template <class Work>
void for_each_block(const VoxelGrid& grid, const BrickCoord& at, const Brick& voxels,
                    VoxelBlock& block, const Work& work) {
  block.places.count = 0;
  for (int z = 0; z < kBrickEdge; ++z) {
    for (uint64_t bits = voxels[z]; bits != 0; bits &= bits - 1) {
      const int bit = std::countr_zero(bits);
      const size_t i = block.places.count++;
      block.number[i] = static_cast<uint16_t>(64 * z + bit);
      block.places.set(
          i, grid.center(8 * at.x + bit % 8, 8 * at.y + bit / 8, 8 * at.z + z).cast<float>());
      if (block.places.count < PointBlock::kCapacity) continue;
      work(block);
      block.places.count = 0;
    }
  }
  if (block.places.count > 0) work(block);
}

/// The pixels of a mask for which chosen(x, y) is true.
template <class Chosen>
Mask those_of(const Mask& mask, const Chosen& chosen) {
  Mask those(mask.size());
  for (int y = 0; y < mask.size().height; ++y) {
    for (int w = 0; w < mask.words_per_row(); ++w) {
      for (uint64_t bits = mask.row(y)[w]; bits != 0; bits &= bits - 1) {
        const int x = 64 * w + std::countr_zero(bits);
        if (chosen(x, y)) those.set(x, y);
      }
    }
  }
  return those;
}

bool has(const Mask& mask, float u, float v) {
  const bool exists = u >= 0 && v >= 0 && u < static_cast<float>(mask.size().width) &&
                      v < static_cast<float>(mask.size().height);
  return exists && mask.get(static_cast<int>(u), static_cast<int>(v));
}

}  // namespace

Mask covered_pixels(const SurfaceCamera& camera, const DepthBuffer& depth) {
  return those_of(camera.silhouette(), [&](int x, int y) { return std::isfinite(depth.at(x, y)); });
}

Mask uncovered_pixels(const Mask& before, const DepthBuffer& after) {
  const Mask uncovered = those_of(before, [&](int x, int y) { return std::isinf(after.at(x, y)); });
  return uncovered.bounding_box().empty() ? uncovered : dilate(open(uncovered, kRim), kRim);
}

std::vector<Brick> voxels_at(std::span<const Mask> pixels, std::span<const SurfaceCamera> cameras,
                             const SparseVolume& volume, std::span<const Brick> some) {
  std::vector<size_t> open;  // cameras with pixels
  for (size_t c = 0; c < cameras.size(); ++c) {
    if (!pixels[c].bounding_box().empty()) open.push_back(c);
  }
  std::vector<Brick> found(some.size(), kEmptyBrick);
  tbb::parallel_for(size_t{0}, open.empty() ? 0 : some.size(), [&](size_t b) {
    if (some[b] == kEmptyBrick) return;
    VoxelBlock block;
    for_each_block(volume.grid(), volume.coords()[b], some[b], block, [&](const VoxelBlock& part) {
      PixelBlock seen;
      for (const size_t c : open) {
        project_block(cameras[c], part.places, seen);
        for (size_t i = 0; i < part.places.count; ++i) {
          if (!has(pixels[c], seen.u[i], seen.v[i])) continue;
          found[b][part.number[i] / 64] |= uint64_t{1} << (part.number[i] % 64);
        }
      }
    });
  });
  return found;
}

}  // namespace v3d
