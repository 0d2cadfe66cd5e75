#include "recon/surface/free_space_votes.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "base/core/check.h"
#include "recon/hull/brick_halo.h"

namespace v3d {

FreeSpaceVotes::FreeSpaceVotes(const SparseVolume& volume)
    : volume_(volume),
      origin_(volume.grid().origin.cast<float>()),
      per_metre_(static_cast<float>(1 / volume.grid().voxel_m)),
      votes_(512 * volume.bricks().size()),
      has_free_(volume.bricks().size()) {}

std::optional<Eigen::Vector3i> FreeSpaceVotes::voxel_at(const Eigen::Vector3f& place) const {
  const Eigen::Vector3f at = (place - origin_) * per_metre_;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(at[axis] >= 0 && at[axis] < VoxelGrid::kMaxCount)) return std::nullopt;
  }
  return at.cast<int>();
}

int FreeSpaceVotes::brick_of(const Eigen::Vector3i& voxel) const {
  return volume_.index_of({voxel.x() / 8, voxel.y() / 8, voxel.z() / 8});
}

int FreeSpaceVotes::brick_at(const Eigen::Vector3f& place) const {
  const auto voxel = voxel_at(place);
  return voxel ? brick_of(*voxel) : -1;
}

void FreeSpaceVotes::vote(const Eigen::Vector3f& place, uint32_t what) {
  const auto voxel = voxel_at(place);
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

std::vector<Brick> FreeSpaceVotes::free_voxels(int min_votes) const {
  V3D_CHECK(min_votes >= 1);
  std::vector<Brick> result(volume_.bricks().size(), kEmptyBrick);
  const auto has_free = [&](int brick) {
    return brick >= 0 && has_free_[brick].load(std::memory_order_relaxed);
  };
  tbb::parallel_for(size_t{0}, result.size(), [&](size_t b) {
    const BricksAround around = bricks_around(volume_, b);
    if (std::ranges::none_of(around, has_free)) return;  // true for most bricks
    const auto counts_of = [&](size_t brick, int row) {
      BrickRow<uint64_t> counts;
      for (int x = 0; x < kBrickEdge; ++x) {
        const uint32_t both =
            votes_[512 * brick + kBrickEdge * row + x].load(std::memory_order_relaxed);
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

}  // namespace v3d
