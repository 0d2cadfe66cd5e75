#include "recon/hull/volume_components.h"

#include <algorithm>

#include "recon/hull/brick_halo.h"

namespace v3d {
namespace {

/// The set voxels of a layer and their neighbours in the layer, including the diagonal ones.
uint64_t dilated_in_layer(uint64_t layer) {
  constexpr uint64_t kFirst = 0x0101010101010101, kLast = kFirst << 7;
  const uint64_t row = layer | (layer << 1 & ~kFirst) | (layer >> 1 & ~kLast);
  return row | row << 8 | row >> 8;
}

/// The set voxels of a layer and their face neighbours in the layer.
uint64_t cross_in_layer(uint64_t layer) {
  constexpr uint64_t kFirst = 0x0101010101010101, kLast = kFirst << 7;
  return layer | (layer << 1 & ~kFirst) | (layer >> 1 & ~kLast) | layer << 8 | layer >> 8;
}

/// Adds to `layer` what is connected to it within `room`.
void fill_layer(uint64_t& layer, uint64_t room) {
  for (uint64_t before = ~layer; before != layer;) {
    before = layer;
    layer |= dilated_in_layer(layer) & room;
  }
}

/// Adds to `bits` what is connected to them within the brick `room`. Requires bits within `room`.
void fill_brick(Brick& bits, const Brick& room) {
  for (Brick before = kFullBrick; before != bits;) {
    before = bits;
    for (int z = 0; z < kBrickEdge; ++z) {
      if (z > 0) bits[z] |= cross_in_layer(bits[z - 1]) & room[z];
      fill_layer(bits[z], room[z]);
    }
    for (int z = kBrickEdge - 2; z >= 0; --z) {
      bits[z] |= cross_in_layer(bits[z + 1]) & room[z];
      fill_layer(bits[z], room[z]);
    }
  }
}

}  // namespace

void VolumeComponents::find(const SparseVolume& volume) {
  const auto bricks = volume.bricks();
  components_.clear();
  parts_.clear();
  left_.assign(bricks.begin(), bricks.end());
  reached_.assign(bricks.size(), kEmptyBrick);
  is_touched_.assign(bricks.size(), 0);
  is_queued_.assign(bricks.size(), 0);
  for (size_t b = 0; b < bricks.size(); ++b) {
    for (int z = 0; z < kBrickEdge; ++z) {
      while (left_[b][z] != 0) {
        flood(volume, b, z);
        collect();
      }
    }
  }
}

size_t VolumeComponents::largest() const {
  const auto more = [](const Component& a, const Component& b) { return a.voxels < b.voxels; };
  return static_cast<size_t>(std::max_element(components_.begin(), components_.end(), more) -
                             components_.begin());
}

std::span<const ComponentPart> VolumeComponents::parts(size_t component) const {
  const Component& c = components_[component];
  return std::span(parts_).subspan(c.first_part, c.parts);
}

/// Reaches the component of the first free voxel in this layer.
void VolumeComponents::flood(const SparseVolume& volume, size_t brick, int z) {
  reached_[brick][z] = left_[brick][z] & -left_[brick][z];
  is_touched_[brick] = is_queued_[brick] = 1;
  touched_.assign(1, static_cast<uint32_t>(brick));
  queue_.assign(1, static_cast<uint32_t>(brick));
  for (size_t next = 0; next < queue_.size(); ++next) grow(volume, queue_[next]);
}

/// Fills one brick from its neighbours, and queues the neighbours that it may fill in turn.
void VolumeComponents::grow(const SparseVolume& volume, size_t brick) {
  is_queued_[brick] = 0;
  const BricksAround around = bricks_around(volume, brick);
  const auto reached_of = [&](size_t b, int z) { return reached_[b][z]; };
  const Brick before = reached_[brick];
  Brick bits = dilated(around, reached_of);
  for (size_t z = 0; z < bits.size(); ++z) bits[z] &= left_[brick][z];
  fill_brick(bits, left_[brick]);
  const bool is_first = touched_.size() == 1 && queue_.size() == 1;
  if (bits == before && !is_first) return;
  reached_[brick] = bits;
  if (!is_touched_[brick]) {
    is_touched_[brick] = 1;
    touched_.push_back(static_cast<uint32_t>(brick));
  }
  for (const int n : around) {
    if (n < 0 || n == static_cast<int>(brick) || is_queued_[n] || left_[n] == reached_[n]) continue;
    is_queued_[n] = 1;
    queue_.push_back(static_cast<uint32_t>(n));
  }
}

/// Makes a component of the reached voxels.
void VolumeComponents::collect() {
  Component component{.first_part = parts_.size(), .parts = touched_.size()};
  std::ranges::sort(touched_);
  for (const uint32_t b : touched_) {
    parts_.push_back({b, reached_[b]});
    for (size_t z = 0; z < kBrickEdge; ++z) {
      component.voxels += bit_count(reached_[b][z]);
      left_[b][z] &= ~reached_[b][z];
    }
    reached_[b] = kEmptyBrick;
    is_touched_[b] = 0;
  }
  components_.push_back(component);
}

}  // namespace v3d
