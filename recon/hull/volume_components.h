// Connected components of a volume.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "recon/hull/sparse_volume.h"

namespace v3d {

/// The voxels of a component that lie in one brick.
struct ComponentPart {
  uint32_t brick = 0;  ///< index into SparseVolume::bricks()
  Brick bits{};
};

/// Finds the connected components of volumes by flood fill, 64 voxels at a time. Two voxels are
/// connected when they share a face or an edge, as in MarchingCubes, so every component has a
/// surface of its own. Keeps its working memory between volumes. One thread. Deterministic.
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
  void flood(const SparseVolume& volume, size_t brick, int z);
  void grow(const SparseVolume& volume, size_t brick);
  void collect();

  std::vector<Component> components_;
  std::vector<ComponentPart> parts_;
  // Working memory, by brick of the volume.
  std::vector<Brick> left_;     ///< voxels that are in no component yet
  std::vector<Brick> reached_;  ///< voxels of the current component; empty between components
  std::vector<uint8_t> is_touched_, is_queued_;
  std::vector<uint32_t> touched_, queue_;
};

}  // namespace v3d
