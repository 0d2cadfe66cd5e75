#include "recon/hull/volume_components.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

#include "recon/hull/brick_halo.h"

namespace v3d::recon {
namespace {

constexpr uint64_t kFirstColumn = 0x0101010101010101, kLastColumn = kFirstColumn << 7;

/// The set voxels of a layer and their neighbours in the layer, including the diagonal ones.
uint64_t dilated_in_layer(uint64_t layer) {
  const uint64_t row = layer | (layer << 1 & ~kFirstColumn) | (layer >> 1 & ~kLastColumn);
  return row | row << 8 | row >> 8;
}

/// The set voxels of a layer and their face neighbours in the layer.
uint64_t cross_in_layer(uint64_t layer) {
  return layer | (layer << 1 & ~kFirstColumn) | (layer >> 1 & ~kLastColumn) | layer << 8 |
         layer >> 8;
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

/// The voxels of a brick with this x, bit 8 z + y.
uint64_t x_face(const codec::Brick& bits, int x) {
  constexpr uint64_t kColumnToByte = 0x0102040810204080;  // moves bit 8 y to bit 56 + y
  uint64_t face = 0;
  for (int z = 0; z < codec::kBrickEdge; ++z) {
    face |= ((bits[z] >> x & kFirstColumn) * kColumnToByte) >> 56 << 8 * z;
  }
  return face;
}
/// The voxels of a brick with this y, bit 8 z + x.
uint64_t y_face(const codec::Brick& bits, int y) {
  uint64_t face = 0;
  for (int z = 0; z < codec::kBrickEdge; ++z) face |= (bits[z] >> 8 * y & 0xFF) << 8 * z;
  return face;
}

/// Directions from a brick to half of the bricks that share a face or an edge with it.
constexpr std::array<std::array<int, 3>, 9> kDirections{{{1, 0, 0},
                                                         {0, 1, 0},
                                                         {0, 0, 1},
                                                         {1, 1, 0},
                                                         {-1, 1, 0},
                                                         {1, 0, 1},
                                                         {-1, 0, 1},
                                                         {0, 1, 1},
                                                         {0, -1, 1}}};

/// Does a voxel of brick `a` share a face or an edge with one of brick `b`, which lies in this
/// direction?
bool are_connected(const codec::Brick& a, const codec::Brick& b,
                   const std::array<int, 3>& direction) {
  const auto [x, y, z] = direction;
  const auto end = [](int d) { return d > 0 ? codec::kBrickEdge - 1 : 0; };
  if (x != 0 && y != 0) {
    const uint64_t of_a = x_face(a, end(x)) >> end(y), of_b = x_face(b, end(-x)) >> end(-y);
    return (of_a & of_b & kFirstColumn) != 0;
  }
  const uint64_t layer_a = a[end(z)], layer_b = b[end(-z)];
  if (x != 0 && z != 0) return (layer_a >> end(x) & layer_b >> end(-x) & kFirstColumn) != 0;
  if (y != 0 && z != 0) return (layer_a >> 8 * end(y) & layer_b >> 8 * end(-y) & 0xFF) != 0;
  if (x != 0) return (cross_in_layer(x_face(a, end(x))) & x_face(b, end(-x))) != 0;
  if (y != 0) return (cross_in_layer(y_face(a, end(y))) & y_face(b, end(-y))) != 0;
  return (cross_in_layer(layer_a) & layer_b) != 0;
}

}  // namespace

void VolumeComponents::find(const SparseVolume& volume) {
  split(volume.bricks());
  join(volume);
  collect();
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

/// Divides each brick into its pieces, sorted by their first voxels.
void VolumeComponents::split(std::span<const codec::Brick> bricks) {
  pieces_.clear();
  first_piece_.clear();
  for (size_t b = 0; b < bricks.size(); ++b) {
    first_piece_.push_back(static_cast<uint32_t>(pieces_.size()));
    codec::Brick left = bricks[b];
    for (int z = 0; z < codec::kBrickEdge; ++z) {
      while (left[z] != 0) {
        Piece& piece = pieces_.emplace_back(Piece{.brick = static_cast<uint32_t>(b)});
        piece.bits[z] = left[z] & -left[z];
        fill_brick(piece.bits, left);
        for (int k = 0; k < codec::kBrickEdge; ++k) left[k] &= ~piece.bits[k];
      }
    }
  }
  first_piece_.push_back(static_cast<uint32_t>(pieces_.size()));
}

void VolumeComponents::join(const SparseVolume& volume) {
  joined_.reset(pieces_.size());
  for (size_t b = 0; b + 1 < first_piece_.size(); ++b) {
    const codec::BrickCoord at = volume.coords()[b];
    for (const auto& direction : kDirections) {
      const auto [x, y, z] = direction;
      const int other = volume.index_of({at.x + x, at.y + y, at.z + z});
      if (other < 0) continue;
      for (uint32_t p = first_piece_[b]; p < first_piece_[b + 1]; ++p) {
        join(p, static_cast<size_t>(other), direction);
      }
    }
  }
}

/// Joins a piece with the pieces of the brick in this direction that it is connected to.
void VolumeComponents::join(uint32_t piece, size_t brick, const std::array<int, 3>& direction) {
  for (uint32_t other = first_piece_[brick]; other < first_piece_[brick + 1]; ++other) {
    if (joined_.find(piece) == joined_.find(other)) continue;
    if (are_connected(pieces_[piece].bits, pieces_[other].bits, direction)) {
      joined_.unite(piece, other);
    }
  }
}

/// Makes the components of the joined pieces.
void VolumeComponents::collect() {
  components_.clear();
  constexpr uint32_t kNone = ~uint32_t{0};
  std::vector<uint32_t> last_brick;
  // Calls action(component, whether this is its first piece in the brick) for each piece.
  const auto each_piece = [&](const auto& action) {
    last_brick.assign(components_.size(), kNone);
    for (const Piece& piece : pieces_) {
      const bool is_new = std::exchange(last_brick[piece.component], piece.brick) != piece.brick;
      action(components_[piece.component], piece, is_new);
    }
  };
  for (uint32_t p = 0; p < pieces_.size(); ++p) {
    const uint32_t first = joined_.find(p);
    if (first == p) components_.emplace_back();
    pieces_[p].component =
        first == p ? static_cast<uint32_t>(components_.size() - 1) : pieces_[first].component;
  }
  size_t parts = 0;
  each_piece([&](Component& component, const Piece&, bool is_new) { component.parts += is_new; });
  for (Component& component : components_) {
    component.first_part = parts;
    parts += std::exchange(component.parts, 0);
  }
  parts_.assign(parts, {});
  each_piece([&](Component& component, const Piece& piece, bool is_new) {
    component.parts += is_new;
    ComponentPart& part = parts_[component.first_part + component.parts - 1];
    part.brick = piece.brick;
    for (size_t z = 0; z < piece.bits.size(); ++z) {
      part.bits[z] |= piece.bits[z];
      component.voxels += codec::bit_count(piece.bits[z]);
    }
  });
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
