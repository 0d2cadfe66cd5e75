#include "recon/performers/performer_labels.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>

namespace v3d::recon {
namespace {

constexpr uint8_t kMixed = 255;

/// The label of each brick whose voxels have one, else kMixed.
std::vector<uint8_t> brick_labels(const SparseVolume& volume,
                                  const std::vector<PerformerVoxels>& performers) {
  std::vector<uint8_t> labels(volume.bricks().size());
  tbb::parallel_for(size_t{0}, labels.size(), [&](size_t b) {
    bool is_empty = true;
    for (const PerformerVoxels& performer : performers) {
      const codec::Brick& voxels = performer.voxels[b];
      if (voxels == codec::kEmptyBrick) continue;
      labels[b] = voxels == volume.bricks()[b] ? performer.identity : kMixed;
      is_empty = false;
    }
    if (is_empty) labels[b] = 0;
  });
  return labels;
}

struct VoxelPlace {
  int brick = -1;
  int layer = 0;
  uint64_t bit = 0;
};

VoxelPlace place_of(const SparseVolume& volume, const std::array<int32_t, 3>& voxel) {
  // Right shifts round down, also for the coordinate -1 outside the grid.
  const codec::BrickCoord at{voxel[0] >> 3, voxel[1] >> 3, voxel[2] >> 3};
  return {volume.index_of(at), voxel[2] & 7,
          uint64_t{1} << (codec::kBrickEdge * (voxel[1] & 7) + (voxel[0] & 7))};
}

/// The end of the edge that is occupied.
VoxelPlace occupied_end(const SparseVolume& volume, codec::LatticeEdge edge) {
  const VoxelPlace place = place_of(volume, edge.voxel);
  if (place.brick >= 0 && (volume.bricks()[place.brick][place.layer] & place.bit) != 0)
    return place;
  edge.voxel[edge.axis] += 1;
  return place_of(volume, edge.voxel);
}

uint8_t label_at(const VoxelPlace& place, const std::vector<PerformerVoxels>& performers) {
  for (const PerformerVoxels& performer : performers) {
    if ((performer.voxels[place.brick][place.layer] & place.bit) != 0) return performer.identity;
  }
  return 0;
}

/// The label of all vertices of a brick of the surface, kMixed where they can differ. The occupied
/// voxels of its vertices lie in the brick and in the next one along each axis.
uint8_t common_label(const SparseVolume& volume, const std::vector<uint8_t>& of_brick,
                     codec::BrickCoord at) {
  int label = -1;
  for (const codec::BrickCoord& next :
       {at, codec::BrickCoord{at.x + 1, at.y, at.z}, codec::BrickCoord{at.x, at.y + 1, at.z},
        codec::BrickCoord{at.x, at.y, at.z + 1}}) {
    const int index = volume.index_of(next);
    if (index < 0) continue;
    if (label >= 0 && label != of_brick[index]) return kMixed;
    label = of_brick[index];
  }
  return label < 0 ? 0 : static_cast<uint8_t>(label);
}

}  // namespace

std::vector<uint8_t> VertexLabels::find(const SparseVolume& volume,
                                        const std::vector<PerformerVoxels>& performers) {
  surface_.begin(volume.view());
  const size_t bricks = surface_.bricks().size();
  tbb::parallel_for(size_t{0}, bricks, [&](size_t n) { surface_.examine(n); });
  surface_.number();
  const std::vector<uint8_t> of_brick = brick_labels(volume, performers);
  std::vector<uint8_t> labels(surface_.vertex_count());
  tbb::parallel_for(size_t{0}, bricks, [&](size_t n) {
    const codec::BrickSurface::SurfaceBrick& brick = surface_.bricks()[n];
    const uint8_t common = common_label(volume, of_brick, brick.at);
    if (common != kMixed) {
      std::fill_n(labels.begin() + brick.first_vertex, brick.vertex_count, common);
      return;
    }
    surface_.for_each_vertex(n, [&](uint32_t vertex, const codec::HalfVoxels& half) {
      labels[vertex] = label_at(occupied_end(volume, codec::edge_at(half)), performers);
    });
  });
  return labels;
}

}  // namespace v3d::recon
