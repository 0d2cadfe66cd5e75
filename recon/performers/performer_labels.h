// The performer of every voxel and of every vertex of a pulse.
#pragma once

#include <cstdint>
#include <vector>

#include "codec/bricks.h"
#include "recon/hull/sparse_volume.h"
#include "recon/performers/voxel_set.h"

namespace v3d::recon {

/// The voxels of one performer, in a volume that is known from the context.
struct PerformerVoxels {
  uint8_t identity = 0;  ///< from 1; numbers of performers who left are not used again
  VoxelSet voxels;       ///< those of different performers are disjoint
};

/// Labels the vertices of surfaces. Keeps its working memory between calls. One caller at a time;
/// works in the caller's TBB arena. Deterministic.
class VertexLabels {
 public:
  /// One label for each vertex of MarchingCubes::run(volume), in its order, also after deformation:
  /// the identity of the occupied voxel at the vertex's edge, 0 where no performer has it.
  std::vector<uint8_t> find(const SparseVolume& volume,
                            const std::vector<PerformerVoxels>& performers);

 private:
  codec::BrickSurface surface_;
};

}  // namespace v3d::recon
