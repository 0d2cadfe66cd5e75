#include "recon/hull/volume_components.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

#include "recon/hull/brick_halo.h"

namespace v3d::recon {
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
void fill_brick(codec::Brick& bits, const codec::Brick& room) {
  for (codec::Brick before = codec::kFullBrick; before != bits;) {
    before = bits;
    for (int z = 0; z < codec::kBrickEdge; ++z) {
      if (z > 0) bits[z] |= cross_in_layer(bits[z - 1]) & room[z];
      fill_layer(bits[z], room[z]);
    }
    for (int z = codec::kBrickEdge - 2; z >= 0; --z) {
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
  reached_.assign(bricks.size(), codec::kEmptyBrick);
  is_touched_.assign(bricks.size(), 0);
  is_queued_.assign(bricks.size(), 0);
  for (size_t b = 0; b < bricks.size(); ++b) {
    for (int z = 0; z < codec::kBrickEdge; ++z) {
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
  const codec::Brick before = reached_[brick];
  codec::Brick bits = dilated(around, reached_of);
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
    for (size_t z = 0; z < codec::kBrickEdge; ++z) {
      component.voxels += codec::bit_count(reached_[b][z]);
      left_[b][z] &= ~reached_[b][z];
    }
    reached_[b] = codec::kEmptyBrick;
    is_touched_[b] = 0;
  }
  components_.push_back(component);
}

VolumeCut::VolumeCut(const SparseVolume& volume, std::vector<codec::Brick> cut)
    : volume_(volume), cut_(std::move(cut)) {
  for (size_t b = 0; b < cut_.size(); ++b) {
    for (size_t z = 0; z < cut_[b].size(); ++z) cut_[b][z] &= volume_.bricks()[b][z];
  }
}

/// The bricks for which chosen(brick) is true, and their neighbours.
template <class Chosen>
std::vector<uint8_t> VolumeCut::near(const Chosen& chosen) const {
  std::vector<uint8_t> near(cut_.size(), 0);
  for (size_t b = 0; b < cut_.size(); ++b) {
    if (!chosen(b)) continue;
    for (const int n : bricks_around(volume_, b)) {
      if (n >= 0) near[n] = 1;
    }
  }
  return near;
}

std::vector<uint8_t> VolumeCut::bricks_near() const {
  return near([&](size_t b) { return cut_[b] != codec::kEmptyBrick; });
}

std::vector<uint8_t> VolumeCut::bricks_near_more_than(std::span<const codec::Brick> less) const {
  return near([&](size_t b) {
    for (size_t z = 0; z < cut_[b].size(); ++z) {
      if ((cut_[b][z] & ~less[b][z]) != 0) return true;
    }
    return false;
  });
}

void VolumeCut::smooth(int passes) {
  const auto cut_of = [&](size_t brick, int z) { return cut_[brick][z]; };
  const auto staying_of = [&](size_t brick, int z) {
    return volume_.bricks()[brick][z] & ~cut_[brick][z];
  };
  std::vector<uint8_t> open = bricks_near();
  for (std::vector<codec::Brick> next; passes > 0; --passes) {
    next = cut_;
    tbb::parallel_for(size_t{0}, cut_.size(), [&](size_t b) {
      if (!open[b]) return;
      const BricksAround around = bricks_around(volume_, b);
      const BrickCounts cut = neighbourhood_counts(around, cut_of);
      const BrickCounts staying = neighbourhood_counts(around, staying_of);
      const codec::Brick more = larger(cut, staying), less = larger(staying, cut);
      for (size_t z = 0; z < codec::kBrickEdge; ++z) {
        next[b][z] = ((next[b][z] & ~less[z]) | more[z]) & volume_.bricks()[b][z];
      }
    });
    cut_.swap(next);
    // In other bricks the next pass would change nothing.
    open = near([&](size_t b) { return cut_[b] != next[b]; });
  }
}

void VolumeCut::add_fragments(int voxels) {
  // A piece that the cut separated has voxels next to the cut.
  std::vector<codec::Brick> beside(cut_.size(), codec::kEmptyBrick);
  const std::vector<uint8_t> open = bricks_near();
  tbb::parallel_for(size_t{0}, cut_.size(), [&](size_t b) {
    if (!open[b]) return;
    const auto cut_of = [&](size_t brick, int z) { return cut_[brick][z]; };
    const BrickCounts counts = neighbourhood_counts(bricks_around(volume_, b), cut_of);
    beside[b] = larger(counts, {});
  });
  const SparseVolume left = remaining();
  const auto brick_of = [&](const ComponentPart& part) {
    return static_cast<size_t>(volume_.index_of(left.coords()[part.brick]));
  };
  const auto is_beside_cut = [&](const ComponentPart& part) {
    const codec::Brick& near = beside[brick_of(part)];
    return !std::ranges::equal(part.bits, near, [](auto a, auto b) { return (a & b) == 0; });
  };
  VolumeComponents components;
  components.find(left);
  for (size_t c = 0; c < components.count(); ++c) {
    const auto parts = components.parts(c);
    if (components.voxels(c) >= voxels || std::ranges::none_of(parts, is_beside_cut)) continue;
    for (const ComponentPart& part : parts) {
      for (size_t z = 0; z < codec::kBrickEdge; ++z) cut_[brick_of(part)][z] |= part.bits[z];
    }
  }
}

void VolumeCut::keep(std::span<const codec::Brick> voxels) {
  for (size_t b = 0; b < cut_.size(); ++b) {
    for (size_t z = 0; z < cut_[b].size(); ++z) cut_[b][z] &= ~voxels[b][z];
  }
}

SparseVolume VolumeCut::remaining() const {
  std::vector<PlacedBrick> left(cut_.size());
  for (size_t b = 0; b < left.size(); ++b) {
    left[b].at = volume_.coords()[b];
    for (size_t z = 0; z < codec::kBrickEdge; ++z)
      left[b].bits[z] = volume_.bricks()[b][z] & ~cut_[b][z];
  }
  const std::span<const PlacedBrick> part(left);
  return SparseVolume(volume_.grid(), {&part, 1});
}

}  // namespace v3d::recon
