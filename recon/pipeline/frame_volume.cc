#include "recon/pipeline/frame_volume.h"

#include <algorithm>
#include <vector>

#include "codec/frame_header.h"
#include "codec/occupancy.h"

namespace v3d::recon {
namespace {

std::optional<codec::FrameHeader> header_with_volume(std::span<const uint8_t> compact) {
  auto header = codec::read_header(compact);
  if (header && header->is(codec::FrameHeader::kExplicit)) header.reset();
  return header;
}

}  // namespace

std::optional<VoxelGrid> frame_grid(std::span<const uint8_t> compact) {
  const auto header = header_with_volume(compact);
  if (!header) return std::nullopt;
  const codec::FrameMetadata& metadata = header->metadata;
  VoxelGrid grid{.origin = {metadata.origin[0], metadata.origin[1], metadata.origin[2]},
                 .voxel_m = 2 * metadata.step * header->subdivision};
  for (size_t axis = 0; axis < 3; ++axis) {
    const int bricks = header->first_brick[axis] + header->bricks[axis];
    grid.counts[axis] = int64_t{codec::kBrickEdge} * std::max(1, bricks);
  }
  return grid;
}

std::optional<SparseVolume> frame_volume(std::span<const uint8_t> compact, const VoxelGrid& grid) {
  const auto header = header_with_volume(compact);
  if (!header) return std::nullopt;
  codec::Occupancy occupancy;
  const auto& first = header->first_brick;
  occupancy.clear({first[0], first[1], first[2]},
                  {header->bricks[0], header->bricks[1], header->bricks[2]});
  if (!decode_occupancy(section(compact, *header, codec::kShape), occupancy)) return std::nullopt;
  std::vector<PlacedBrick> bricks;
  for (size_t n = 0; n < occupancy.bricks.size(); ++n) {
    const codec::BrickCoord at = occupancy.coords[n];
    bricks.push_back({{at.x + first[0], at.y + first[1], at.z + first[2]}, occupancy.bricks[n]});
  }
  const std::span<const PlacedBrick> part(bricks);
  return SparseVolume(grid, {&part, 1});
}

}  // namespace v3d::recon
