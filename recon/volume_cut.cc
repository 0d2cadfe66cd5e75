#include "recon/volume_cut.h"

#include <tbb/parallel_for.h>

#include <array>
#include <utility>

#include "recon/brick_halo.h"

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

/// The bricks for which chosen(brick), and those around them.
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

void VolumeCut::smooth(int passes) {
  // Voxels that are cut count 1, occupied ones 256.
  const auto counts_of = [&](size_t brick, int row) {
    const BrickRow<uint8_t>& cut = bits_of_row(cut_[brick], row);
    const BrickRow<uint8_t>& occupied = bits_of_row(volume_.bricks()[brick], row);
    BrickRow<uint16_t> counts;
    for (int x = 0; x < kBrickEdge; ++x) {
      counts[x] = static_cast<uint16_t>(cut[x] | occupied[x] << 8);
    }
    return counts;
  };
  std::vector<uint8_t> open = near([&](size_t b) { return cut_[b] != kEmptyBrick; });
  for (std::vector<Brick> next; passes > 0; --passes) {
    next = cut_;
    tbb::parallel_for(size_t{0}, cut_.size(), [&](size_t b) {
      if (!open[b]) return;
      const auto sums = sums_of_27<uint16_t>(bricks_around(volume_, b), counts_of);
      for (size_t z = 0; z < kBrickEdge; ++z) {
        uint64_t more = 0, less = 0;
        for (int i = 0; i < 64; ++i) {
          const int twice = 2 * (sums[64 * z + i] & 255), all = sums[64 * z + i] >> 8;
          more |= uint64_t{twice > all} << i;
          less |= uint64_t{twice < all} << i;
        }
        next[b][z] = ((next[b][z] & ~less) | more) & volume_.bricks()[b][z];
      }
    });
    cut_.swap(next);
    // The others would find what they found before.
    open = near([&](size_t b) { return cut_[b] != next[b]; });
  }
}

/// Floods what stays, from voxel to voxel.
class VolumeCut::Crumbs {
 public:
  Crumbs(const SparseVolume& volume, std::vector<Brick>& cut, int voxels)
      : volume_(volume),
        cut_(cut),
        voxels_(static_cast<size_t>(voxels)),
        reached_(cut.size(), kEmptyBrick),
        large_(cut.size(), kEmptyBrick) {}

  /// Adds the piece that the voxel belongs to, if it stays and its piece is small.
  void add_piece_of(size_t brick, int voxel) {
    if (!stays({brick, voxel}) || has(reached_[brick], voxel)) return;
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

  bool stays(const Voxel& v) const {
    return has(volume_.bricks()[v.brick], v.number) && !has(cut_[v.brick], v.number);
  }
  void reach(const Voxel& v) {
    set(reached_[v.brick], v.number, true);
    piece_.push_back(v);
  }

  /// Grows the piece until nothing is left to add; false as soon as it is known to be large.
  bool flood() {
    for (size_t next = 0; next < piece_.size(); ++next) {
      if (piece_.size() >= voxels_ || grows_into_large(piece_[next])) return false;
    }
    return true;
  }

  /// Adds the neighbours of a voxel to the piece; stops at one of a large piece.
  bool grows_into_large(const Voxel& v) {
    const BrickCoord at = volume_.coords()[v.brick];
    const std::array<int, 3> place{8 * at.x + v.number % 8, 8 * at.y + v.number / 8 % 8,
                                   8 * at.z + v.number / 64};
    for (const auto& [x, y, z] : kWays) {
      const int i = place[0] + x, j = place[1] + y, k = place[2] + z;
      const int brick = i < 0 || j < 0 || k < 0 ? -1 : volume_.index_of({i / 8, j / 8, k / 8});
      if (brick < 0) continue;
      const Voxel n{static_cast<size_t>(brick), 64 * (k % 8) + 8 * (j % 8) + i % 8};
      if (!stays(n)) continue;
      if (has(large_[n.brick], n.number)) return true;
      if (!has(reached_[n.brick], n.number)) reach(n);
    }
    return false;
  }

  /// To the 18 voxels that share a face or an edge.
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
  std::vector<Brick> reached_;  ///< in a piece
  std::vector<Brick> large_;    ///< in one that stays
  std::vector<Voxel> piece_;    ///< at work
};

void VolumeCut::add_crumbs(int voxels) {
  // A severed piece has voxels beside the cut.
  std::vector<Brick> beside(cut_.size(), kEmptyBrick);
  const std::vector<uint8_t> open = near([&](size_t b) { return cut_[b] != kEmptyBrick; });
  tbb::parallel_for(size_t{0}, cut_.size(), [&](size_t b) {
    if (!open[b]) return;
    const auto cut_at = [&](size_t brick, int row) { return bits_of_row(cut_[brick], row); };
    const auto sums = sums_of_27<uint8_t>(bricks_around(volume_, b), cut_at);
    for (int voxel = 0; voxel < 512; ++voxel) {
      beside[b][voxel / 64] |= uint64_t{sums[voxel] > 0} << (voxel % 64);
    }
  });
  Crumbs crumbs(volume_, cut_, voxels);
  for (size_t b = 0; b < beside.size(); ++b) {
    for (int voxel = 0; voxel < 512; ++voxel) {
      if (has(beside[b], voxel)) crumbs.add_piece_of(b, voxel);
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
