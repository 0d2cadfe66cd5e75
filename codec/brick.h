// Brick: 8 x 8 x 8 voxels of a volume, one bit each.
#pragma once

#include <array>
#include <cstdint>

namespace v3d {

/// Voxel (x, y, z) of the brick is bit 8 * y + x (least significant first) of word z.
using Brick = std::array<uint64_t, 8>;

inline constexpr int kBrickEdge = 8;
inline constexpr uint64_t kFullLayer = ~uint64_t{0};
inline constexpr Brick kEmptyBrick{};
inline constexpr Brick kFullBrick{kFullLayer, kFullLayer, kFullLayer, kFullLayer,
                                  kFullLayer, kFullLayer, kFullLayer, kFullLayer};

}  // namespace v3d
