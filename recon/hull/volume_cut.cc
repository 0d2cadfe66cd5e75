#include "recon/hull/volume_cut.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <optional>
#include <utility>

#include "recon/hull/brick_halo.h"

namespace v3d {
namespace {

bool has(const Brick& brick, int voxel) { return (brick[voxel / 64] >> (voxel % 64) & 1) != 0; }

void set(Brick& brick, int voxel, bool value) {
  const uint64_t bit = uint64_t{1} << (voxel % 64);
  brick[voxel / 64] = value ? brick[voxel / 64] | bit : brick[voxel / 64] & ~bit;
}

}  // namespace

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

/// Flood fill of the remaining voxels.
class VolumeCut::Fragments {
 public:
  Fragments(const SparseVolume& volume, std::vector<Brick>& cut, int voxels)
      : volume_(volume),
        cut_(cut),
        voxels_(static_cast<size_t>(voxels)),
        reached_(cut.size(), kEmptyBrick),
        large_(cut.size(), kEmptyBrick) {
    tbb::parallel_for(size_t{0}, cut.size(), [&](size_t b) {
      if (is_core(b)) large_[b].fill(~uint64_t{0});
    });
  }

  /// Adds the piece that contains the voxel to the cut, if the voxel is not cut and the piece is
  /// small.
  void add_piece_of(size_t brick, int voxel) {
    if (!stays({brick, voxel}) || has(reached_[brick], voxel) || has(large_[brick], voxel)) return;
    piece_.clear();
    reach({brick, voxel});
    const bool small = flood();
    for (const Voxel& v : piece_) set((small ? cut_ : large_)[v.brick], v.number, true);
  }

 private:
  struct Voxel {
    size_t brick;
    int number;
  };

  bool is_whole(size_t brick) const {
    return std::ranges::all_of(volume_.bricks()[brick], [](uint64_t z) { return z + 1 == 0; }) &&
           cut_[brick] == kEmptyBrick;
  }
  /// True when the brick and its face neighbours contain enough voxels for a large piece. Only
  /// complete bricks count. A flood fill can stop at such a brick.
  bool is_core(size_t brick) const {
    if (!is_whole(brick)) return false;
    size_t voxels = 512;
    const BrickCoord at = volume_.coords()[brick];
    for (const int way : {-1, 1}) {
      for (const int beside :
           {volume_.index_of({at.x + way, at.y, at.z}), volume_.index_of({at.x, at.y + way, at.z}),
            volume_.index_of({at.x, at.y, at.z + way})}) {
        if (beside >= 0 && is_whole(beside)) voxels += 512;
      }
    }
    return voxels >= voxels_;
  }

  bool stays(const Voxel& v) const {
    return has(volume_.bricks()[v.brick], v.number) && !has(cut_[v.brick], v.number);
  }
  void reach(const Voxel& v) {
    set(reached_[v.brick], v.number, true);
    piece_.push_back(v);
  }

  /// Grows the piece until it is complete. Returns false as soon as the piece is known to be large.
  bool flood() {
    for (size_t next = 0; next < piece_.size(); ++next) {
      if (piece_.size() >= voxels_ || grows_into_large(piece_[next])) return false;
    }
    return true;
  }

  /// Adds the neighbours of a voxel to the piece. Returns true at a voxel of a large piece. Takes
  /// the voxel by value, because growing the piece moves its storage.
  bool grows_into_large(Voxel v) {
    for (const auto& [x, y, z] : kWays) {
      const std::optional<Voxel> n = beside(v, x, y, z);
      if (!n || !stays(*n)) continue;
      if (has(large_[n->brick], n->number)) return true;
      if (!has(reached_[n->brick], n->number)) reach(*n);
    }
    return false;
  }

  /// The neighbouring voxel; empty where no brick is stored.
  std::optional<Voxel> beside(const Voxel& v, int dx, int dy, int dz) const {
    const int x = v.number % 8 + dx, y = v.number / 8 % 8 + dy, z = v.number / 64 + dz;
    const int number = 64 * (z & 7) + 8 * (y & 7) + (x & 7);
    if (((x | y | z) & ~7) == 0) return Voxel{v.brick, number};
    const BrickCoord at = volume_.coords()[v.brick];
    const int brick = volume_.index_of({at.x + (x >> 3), at.y + (y >> 3), at.z + (z >> 3)});
    if (brick < 0) return std::nullopt;
    return Voxel{static_cast<size_t>(brick), number};
  }

  /// Offsets to the 18 voxels that share a face or an edge.
  static constexpr auto kWays = [] {
    std::array<std::array<int, 3>, 18> ways{};
    size_t count = 0;
    for (int n = 0; n < 27; ++n) {
      const std::array<int, 3> way{n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
      const int axes = (way[0] != 0) + (way[1] != 0) + (way[2] != 0);
      if (axes == 1 || axes == 2) ways[count++] = way;
    }
    return ways;
  }();

  const SparseVolume& volume_;
  std::vector<Brick>& cut_;
  const size_t voxels_;
  std::vector<Brick> reached_;  ///< voxels of all pieces so far
  std::vector<Brick> large_;    ///< voxels of large pieces, which stay
  std::vector<Voxel> piece_;    ///< the current piece
};

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
  Fragments fragments(volume_, cut_, voxels);
  for (size_t b = 0; b < beside.size(); ++b) {
    for (int z = 0; z < kBrickEdge; ++z) {
      for (uint64_t voxels_left = beside[b][z]; voxels_left != 0; voxels_left &= voxels_left - 1) {
        fragments.add_piece_of(b, 64 * z + std::countr_zero(voxels_left));
      }
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
