// Components of a volume and cuts of it.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/core/union_find.h"
#include "recon/hull/sparse_volume.h"

namespace v3d::recon {

// Connected components of a volume.

/// The voxels of a component that lie in one brick.
struct ComponentPart {
  uint32_t brick = 0;  ///< index into SparseVolume::bricks()
  codec::Brick bits{};
};

/// Finds the connected components of volumes. Two voxels are connected when they share a face or an
/// edge, as in MarchingCubes, so every component has a surface of its own. Flood fill, 64 voxels at
/// a time, divides each brick into pieces; union-find joins pieces of adjacent bricks. Keeps its
/// working memory between volumes. One thread. Deterministic.
class VolumeComponents {
 public:
  /// Finds the components of `volume`; replaces the previous ones.
  void find(const SparseVolume& volume);

  /// Number of components. They are sorted by the brick of their first voxel.
  size_t count() const { return components_.size(); }
  /// Number of voxels of a component.
  int64_t voxels(size_t component) const { return components_[component].voxels; }
  /// The component with the most voxels; the first of several. Requires count() > 0.
  size_t largest() const;
  /// The voxels of a component, each brick once.
  std::span<const ComponentPart> parts(size_t component) const;

 private:
  struct Component {
    size_t first_part = 0;
    size_t parts = 0;
    int64_t voxels = 0;
  };
  /// Connected voxels of one brick.
  struct Piece {
    uint32_t brick = 0;
    uint32_t component = 0;
    codec::Brick bits{};
  };
  void split(std::span<const codec::Brick> bricks);
  void join(const SparseVolume& volume);
  void join(uint32_t piece, size_t brick, const std::array<int, 3>& direction);
  void collect();

  std::vector<Component> components_;
  std::vector<ComponentPart> parts_;
  // Working memory.
  std::vector<Piece> pieces_;          ///< sorted by brick
  std::vector<uint32_t> first_piece_;  ///< [brick]; one more at the end
  UnionFind joined_;                   ///< pieces
};

// A set of voxels to be removed from a volume, with the filters that clean it up.

/// Borrows the volume, which must not change. One caller at a time; works in the caller's TBB
/// arena. Independent of thread count.
class VolumeCut {
 public:
  /// One brick of `cut` for each of the volume; voxels that are not occupied are ignored.
  VolumeCut(const SparseVolume& volume, std::vector<codec::Brick> cut);

  /// Smooths the boundary between removed and kept voxels: `passes` times, each voxel takes the
  /// majority of the occupied voxels among the 27 in and around it. Empty voxels do not count, so
  /// that slender parts remain.
  void smooth(int passes);
  /// Adds connected pieces of fewer than `voxels` voxels that the cut separated from the rest.
  /// Voxels are connected by faces and edges, as in MarchingCubes.
  void add_fragments(int voxels);

  /// Takes `voxels` out of the cut; one brick for each of the volume.
  void keep(std::span<const codec::Brick> voxels);

  const std::vector<codec::Brick>& bricks() const { return cut_; }
  /// One entry per brick of the volume: 1 where something is cut in the brick or in one of its
  /// neighbours.
  std::vector<uint8_t> bricks_near() const;
  /// The same for the voxels of this cut that the cut `less` does not have.
  std::vector<uint8_t> bricks_near_more_than(std::span<const codec::Brick> less) const;
  /// The volume without the cut.
  SparseVolume remaining() const;

 private:
  template <class Chosen>
  std::vector<uint8_t> near(const Chosen& chosen) const;

  const SparseVolume& volume_;
  std::vector<codec::Brick> cut_;
};

}  // namespace v3d::recon
