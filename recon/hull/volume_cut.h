// A part of a volume that is to be taken out of it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "recon/hull/sparse_volume.h"

namespace v3d {

/// Borrows the volume, which must not change before remaining(). One caller at a time; works in the
/// caller's TBB arena. Results do not depend on the number of threads.
class VolumeCut {
 public:
  /// A brick of `cut` for each of the volume; voxels that are not occupied do not count.
  VolumeCut(const SparseVolume& volume, std::vector<Brick> cut);

  /// Smooths the face between what goes and what stays: `passes` times every voxel does as most of
  /// the occupied ones among the 27 in and around it. The surface of the volume elsewhere does not
  /// count, so that slender parts stay.
  void smooth(int passes);
  /// Adds the pieces of fewer than `voxels` that the cut has severed from all the rest. Voxels are
  /// joined by faces and edges, as MarchingCubes joins them.
  void add_fragments(int voxels);

  /// Of the volume's bricks, those voxels do not go.
  void keep(std::span<const Brick> voxels);

  const std::vector<Brick>& bricks() const { return cut_; }
  /// One per brick of the volume: not 0 where something is cut in it or in one around it.
  std::vector<uint8_t> bricks_near() const;
  /// The same of what goes beyond another cut of the volume, `less`.
  std::vector<uint8_t> bricks_near_more_than(std::span<const Brick> less) const;
  SparseVolume remaining() const;

 private:
  class Fragments;
  template <class Chosen>
  std::vector<uint8_t> near(const Chosen& chosen) const;

  const SparseVolume& volume_;
  std::vector<Brick> cut_;
};

}  // namespace v3d
