#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "base/core/error.h"
#include "base/image/mask_operations.h"
#include "recon/hull/brick_halo.h"
#include "recon/surface/concavity_carving.h"
#include "recon/visibility/vertex_visibility.h"

namespace v3d::recon {

FreeSpaceVotes::FreeSpaceVotes(const SparseVolume& volume)
    : volume_(volume),
      origin_(volume.grid().origin.cast<float>()),
      per_metre_(static_cast<float>(1 / volume.grid().voxel_m)),
      votes_(512 * volume.bricks().size()),
      has_free_(volume.bricks().size()) {}

std::optional<Eigen::Vector3i> FreeSpaceVotes::voxel_at(const Eigen::Vector3f& position) const {
  const Eigen::Vector3f at = (position - origin_) * per_metre_;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(at[axis] >= 0 && at[axis] < VoxelGrid::kMaxCount)) return std::nullopt;
  }
  return at.cast<int>();
}

int FreeSpaceVotes::brick_of(const Eigen::Vector3i& voxel) const {
  return volume_.index_of({voxel.x() / 8, voxel.y() / 8, voxel.z() / 8});
}

int FreeSpaceVotes::brick_at(const Eigen::Vector3f& position) const {
  const auto voxel = voxel_at(position);
  return voxel ? brick_of(*voxel) : -1;
}

void FreeSpaceVotes::vote(const Eigen::Vector3f& position, uint32_t what) {
  const auto voxel = voxel_at(position);
  const int brick = voxel ? brick_of(*voxel) : -1;
  if (brick < 0) return;
  const int inside = 64 * (voxel->z() % 8) + 8 * (voxel->y() % 8) + voxel->x() % 8;
  std::atomic<uint32_t>& both = votes_[512 * static_cast<size_t>(brick) + inside];
  const uint32_t full = what >= kOccupied ? kMaxVotes * kOccupied : kMaxVotes;
  uint32_t before = both.load(std::memory_order_relaxed);
  do {
    if ((before & full) != 0) return;
  } while (!both.compare_exchange_weak(before, before + what, std::memory_order_relaxed));
  if (what >= kOccupied || has_free_[brick].load(std::memory_order_relaxed)) return;
  has_free_[brick].store(true, std::memory_order_relaxed);
}

std::vector<codec::Brick> FreeSpaceVotes::free_voxels(int min_votes) const {
  V3D_CHECK(min_votes >= 1);
  std::vector<codec::Brick> result(volume_.bricks().size(), codec::kEmptyBrick);
  const auto has_free = [&](int brick) {
    return brick >= 0 && has_free_[brick].load(std::memory_order_relaxed);
  };
  tbb::parallel_for(size_t{0}, result.size(), [&](size_t b) {
    const BricksAround around = bricks_around(volume_, b);
    if (std::ranges::none_of(around, has_free)) return;  // true for most bricks
    const auto counts_of = [&](size_t brick, int row) {
      BrickRow<uint64_t> counts;
      for (int x = 0; x < codec::kBrickEdge; ++x) {
        const uint32_t both =
            votes_[512 * brick + codec::kBrickEdge * row + x].load(std::memory_order_relaxed);
        const uint32_t free = std::min(both % kOccupied, kMaxVotes),
                       occupied = std::min(both / kOccupied, kMaxVotes);
        counts[x] = free | uint64_t{occupied} << 32;
      }
      return counts;
    };
    const auto sums = neighbourhood_sums<uint64_t>(around, counts_of);
    for (int voxel = 0; voxel < 512; ++voxel) {
      const auto free = static_cast<uint32_t>(sums[voxel]),
                 occupied = static_cast<uint32_t>(sums[voxel] >> 32);
      if (free >= static_cast<uint32_t>(min_votes) && free > occupied) {
        result[b][voxel / 64] |= uint64_t{1} << (voxel % 64);
      }
    }
    for (size_t z = 0; z < result[b].size(); ++z) result[b][z] &= volume_.bricks()[b][z];
  });
  return result;
}

namespace {

/// Pixels by which surfaces of voxels may miss the outline.
constexpr int kRim = 1;

/// Voxels of a brick: their numbers and positions.
struct VoxelBlock {
  std::array<uint16_t, PointBlock::kCapacity> number;
  PointBlock positions;
};

/// Calls work(VoxelBlock) for all voxels, in blocks.
template <class Work>
void for_each_block(const VoxelGrid& grid, const codec::BrickCoord& at, const codec::Brick& voxels,
                    VoxelBlock& block, const Work& work) {
  block.positions.count = 0;
  for (int z = 0; z < codec::kBrickEdge; ++z) {
    for (uint64_t bits = voxels[z]; bits != 0; bits &= bits - 1) {
      const int bit = std::countr_zero(bits);
      const size_t i = block.positions.count++;
      block.number[i] = static_cast<uint16_t>(64 * z + bit);
      block.positions.set(
          i, grid.center(8 * at.x + bit % 8, 8 * at.y + bit / 8, 8 * at.z + z).cast<float>());
      if (block.positions.count < PointBlock::kCapacity) continue;
      work(block);
      block.positions.count = 0;
    }
  }
  if (block.positions.count > 0) work(block);
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

std::vector<codec::Brick> voxels_at(std::span<const Mask> pixels,
                                    std::span<const SurfaceCamera> cameras,
                                    const SparseVolume& volume,
                                    std::span<const codec::Brick> some) {
  std::vector<size_t> open;  // cameras with pixels
  for (size_t c = 0; c < cameras.size(); ++c) {
    if (!pixels[c].bounding_box().empty()) open.push_back(c);
  }
  std::vector<codec::Brick> found(some.size(), codec::kEmptyBrick);
  tbb::parallel_for(size_t{0}, open.empty() ? 0 : some.size(), [&](size_t b) {
    if (some[b] == codec::kEmptyBrick) return;
    VoxelBlock block;
    for_each_block(volume.grid(), volume.coords()[b], some[b], block, [&](const VoxelBlock& part) {
      PixelBlock seen;
      for (const size_t c : open) {
        project_block(cameras[c], part.positions, seen);
        for (size_t i = 0; i < part.positions.count; ++i) {
          if (!has(pixels[c], seen.u[i], seen.v[i])) continue;
          found[b][part.number[i] / 64] |= uint64_t{1} << (part.number[i] % 64);
        }
      }
    });
  });
  return found;
}

}  // namespace v3d::recon
