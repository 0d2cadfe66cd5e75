#include "recon/hull/volume_cut.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

#include "recon/hull/brick_halo.h"
#include "recon/hull/volume_components.h"

namespace v3d {

VolumeCut::VolumeCut(const SparseVolume& volume, std::vector<Brick> cut)
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
  return near([&](size_t b) { return cut_[b] != kEmptyBrick; });
}

std::vector<uint8_t> VolumeCut::bricks_near_more_than(std::span<const Brick> less) const {
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
  for (std::vector<Brick> next; passes > 0; --passes) {
    next = cut_;
    tbb::parallel_for(size_t{0}, cut_.size(), [&](size_t b) {
      if (!open[b]) return;
      const BricksAround around = bricks_around(volume_, b);
      const BrickCounts cut = neighbourhood_counts(around, cut_of);
      const BrickCounts staying = neighbourhood_counts(around, staying_of);
      const Brick more = larger(cut, staying), less = larger(staying, cut);
      for (size_t z = 0; z < kBrickEdge; ++z) {
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
  std::vector<Brick> beside(cut_.size(), kEmptyBrick);
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
    const Brick& near = beside[brick_of(part)];
    return !std::ranges::equal(part.bits, near, [](auto a, auto b) { return (a & b) == 0; });
  };
  VolumeComponents components;
  components.find(left);
  for (size_t c = 0; c < components.count(); ++c) {
    const auto parts = components.parts(c);
    if (components.voxels(c) >= voxels || std::ranges::none_of(parts, is_beside_cut)) continue;
    for (const ComponentPart& part : parts) {
      for (size_t z = 0; z < kBrickEdge; ++z) cut_[brick_of(part)][z] |= part.bits[z];
    }
  }
}

void VolumeCut::keep(std::span<const Brick> voxels) {
  for (size_t b = 0; b < cut_.size(); ++b) {
    for (size_t z = 0; z < cut_[b].size(); ++z) cut_[b][z] &= ~voxels[b][z];
  }
}

SparseVolume VolumeCut::remaining() const {
  std::vector<PlacedBrick> left(cut_.size());
  for (size_t b = 0; b < left.size(); ++b) {
    left[b].at = volume_.coords()[b];
    for (size_t z = 0; z < kBrickEdge; ++z) left[b].bits[z] = volume_.bricks()[b][z] & ~cut_[b][z];
  }
  const std::span<const PlacedBrick> part(left);
  return SparseVolume(volume_.grid(), {&part, 1});
}

}  // namespace v3d
