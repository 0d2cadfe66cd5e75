#include "recon/hull/sparse_volume.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <random>

#include "recon/random_rig.h"

namespace v3d::recon {
namespace {

VoxelGrid random_grid() {
  return small_grid(uniform_int(1, 30), uniform_int(1, 30), uniform_int(1, 30));
}

/// Occupied or not, for each voxel of a grid, x fastest. Whole bricks are empty as a rule.
class DenseVolume {
 public:
  explicit DenseVolume(const VoxelGrid& grid) : grid_(grid) {
    std::mt19937 random(*rc::gen::arbitrary<uint32_t>());
    const int n = uniform_int(0, 200);
    for (int i = 0; i < n; ++i) {
      const int half = uniform_int(0, 3);
      voxels_.push_back({static_cast<int>(random() % grid.counts[0]),
                         static_cast<int>(random() % grid.counts[1]),
                         static_cast<int>(random() % grid.counts[2]) / (half + 1)});
    }
    std::sort(voxels_.begin(), voxels_.end());
    voxels_.erase(std::unique(voxels_.begin(), voxels_.end()), voxels_.end());
  }
  bool get(int i, int j, int k) const {
    return std::binary_search(voxels_.begin(), voxels_.end(), std::array<int, 3>{i, j, k});
  }
  SparseVolume sparse() const {
    return make_volume(grid_, [&](int i, int j, int k) { return get(i, j, k); });
  }
  const std::vector<std::array<int, 3>>& voxels() const { return voxels_; }

 private:
  VoxelGrid grid_;
  std::vector<std::array<int, 3>> voxels_;
};

RC_GTEST_PROP(SparseVolume, has_exactly_the_voxels_that_were_put_in, ()) {
  const VoxelGrid grid = random_grid();
  const DenseVolume dense(grid);
  const SparseVolume volume = dense.sparse();
  RC_ASSERT(volume.count() == std::ssize(dense.voxels()));
  for (int k = -1; k <= grid.counts[2]; ++k) {
    for (int j = -1; j <= grid.counts[1]; ++j) {
      for (int i = -1; i <= grid.counts[0]; ++i) {
        RC_ASSERT(volume.get(i, j, k) == dense.get(i, j, k));
      }
    }
  }
}

RC_GTEST_PROP(SparseVolume, stores_no_empty_brick_and_sorts_the_others, ()) {
  const SparseVolume volume = DenseVolume(random_grid()).sparse();
  const auto coords = volume.coords();
  for (size_t n = 0; n < coords.size(); ++n) {
    RC_ASSERT(volume.bricks()[n] != codec::kEmptyBrick);
    RC_ASSERT(volume.index_of(coords[n]) == static_cast<int>(n));
    const auto key = [](codec::BrickCoord at) { return std::array{at.z, at.y, at.x}; };
    if (n > 0) RC_ASSERT(key(coords[n - 1]) < key(coords[n]));
  }
}

RC_GTEST_PROP(SparseVolume, depends_neither_on_the_order_of_bricks_nor_on_their_parts, ()) {
  const VoxelGrid grid = random_grid();
  const SparseVolume volume = DenseVolume(grid).sparse();
  std::vector<PlacedBrick> bricks;
  for (size_t n = 0; n < volume.bricks().size(); ++n) {
    bricks.push_back({volume.coords()[n], volume.bricks()[n]});
  }
  std::shuffle(bricks.begin(), bricks.end(), std::mt19937(*rc::gen::arbitrary<uint32_t>()));
  const auto cut = static_cast<size_t>(uniform_int(0, static_cast<int>(bricks.size()) + 1));
  const std::array<std::span<const PlacedBrick>, 2> parts{std::span(bricks).first(cut),
                                                          std::span(bricks).subspan(cut)};
  SparseVolume again = DenseVolume(random_grid()).sparse();  // memory of another volume
  again.assign(grid, parts);
  RC_ASSERT(again == volume);
}

RC_GTEST_PROP(SparseVolume, counts_common_and_differing_voxels, ()) {
  const VoxelGrid grid = random_grid();
  const DenseVolume a(grid), b(grid);
  const auto common = std::count_if(a.voxels().begin(), a.voxels().end(),
                                    [&](const auto& v) { return b.get(v[0], v[1], v[2]); });
  RC_ASSERT(count_common(a.sparse(), b.sparse()) == common);
  RC_ASSERT(count_differing(a.sparse(), b.sparse()) ==
            std::ssize(a.voxels()) + std::ssize(b.voxels()) - 2 * common);
}

RC_GTEST_PROP(BitsInside, are_the_voxels_of_a_brick_that_the_grid_contains, ()) {
  const VoxelGrid grid = random_grid();
  const codec::BrickCoord at{uniform_int(0, 5), uniform_int(0, 5), uniform_int(0, 5)};
  const codec::Brick bits = bits_inside(grid, at);
  for (int n = 0; n < 512; ++n) {
    const bool inside = grid.contains(8 * at.x + n % 8, 8 * at.y + n / 8 % 8, 8 * at.z + n / 64);
    RC_ASSERT((bits[n / 64] >> (n % 64) & 1) == (inside ? 1U : 0U));
  }
}

}  // namespace
}  // namespace v3d::recon
