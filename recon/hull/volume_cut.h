// A set of voxels to be removed from a volume, with the filters that clean it up.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "recon/hull/sparse_volume.h"

namespace v3d {

/// Borrows the volume, which must not change. One caller at a time; works in the caller's TBB
/// arena. Independent of thread count.
class VolumeCut {
 public:
  /// One brick of `cut` for each of the volume; voxels that are not occupied are ignored.
  VolumeCut(const SparseVolume& volume, std::vector<Brick> cut);

  /// Smooths the boundary between removed and kept voxels: `passes` times, each voxel takes the
  /// majority of the occupied voxels among the 27 in and around it. Empty voxels do not count, so
  /// that slender parts remain.
  void smooth(int passes);
  /// Adds connected pieces of fewer than `voxels` voxels that the cut separated from the rest.
  /// Voxels are connected by faces and edges, as in MarchingCubes.
  void add_fragments(int voxels);

  /// Takes `voxels` out of the cut; one brick for each of the volume.
  void keep(std::span<const Brick> voxels);

  const std::vector<Brick>& bricks() const { return cut_; }
  /// One entry per brick of the volume: 1 where something is cut in the brick or in one of its
  /// neighbours.
  std::vector<uint8_t> bricks_near() const;
  /// The same for the voxels of this cut that the cut `less` does not have.
  std::vector<uint8_t> bricks_near_more_than(std::span<const Brick> less) const;
  /// The volume without the cut.
  SparseVolume remaining() const;

 private:
  template <class Chosen>
  std::vector<uint8_t> near(const Chosen& chosen) const;

  const SparseVolume& volume_;
  std::vector<Brick> cut_;
};

}  // namespace v3d
