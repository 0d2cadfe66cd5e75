// Coarse to fine: bricks are empty, full or mixed; so are the cells of 2 x 2 x 2 voxels in mixed
// bricks. In mixed cells, every voxel is coded. Each item is predicted from its neighbours: those
// already coded, and the coarser level of those not yet coded.
#include "codec/occupancy.h"

#include <algorithm>
#include <bit>

#include "codec/entropy_coder.h"

namespace v3d::codec {
namespace {

enum class Fill : uint8_t { kEmpty, kMixed, kFull };

/// Codes a Fill as two bits: is it not empty, and if so, is it full?
class FillModel {
 public:
  template <class Coder>
  Fill code(Coder& coder, Fill fill) {
    if (!coder.bit(some_, fill != Fill::kEmpty)) return Fill::kEmpty;
    return coder.bit(full_, fill == Fill::kFull) ? Fill::kFull : Fill::kMixed;
  }

 private:
  BitModel some_, full_;
};

constexpr uint64_t kColumnX0 = 0x0101010101010101;
constexpr uint64_t kColumnX7 = kColumnX0 << 7;
constexpr uint64_t kRowY0 = 0xFF;

// Bit b of the result is the neighbour of voxel b on one side of a layer; `from` is the layer of
// the neighbouring brick on that side.
uint64_t lower_x_neighbours(uint64_t layer, uint64_t from) {
  return (layer << 1 & ~kColumnX0) | (from >> 7 & kColumnX0);
}
uint64_t lower_y_neighbours(uint64_t layer, uint64_t from) { return layer << 8 | from >> 56; }
uint64_t upper_x_neighbours(uint64_t layer, uint64_t from) {
  return (layer >> 1 & ~kColumnX7) | (from << 7 & kColumnX7);
}
uint64_t upper_y_neighbours(uint64_t layer, uint64_t from) {
  return layer >> 8 | (from & kRowY0) << 56;
}

/// The cells of a brick, one bit each: cell (x, y, z) is bit x + 4 * y + 16 * z.
struct Cells {
  uint64_t some = 0;  ///< with an occupied voxel
  uint64_t all = 0;   ///< without an empty voxel

  Fill at(int cell) const { return static_cast<Fill>((some >> cell & 1) + (all >> cell & 1)); }
};

Cells cells_of(const Brick& brick) {
  Cells cells;
  for (int cell = 0; cell < 64; ++cell) {
    const int shift = 2 * (cell % 4) + 16 * (cell / 4 % 4);
    constexpr uint64_t kSquare = 0x303;
    const uint64_t low = brick[cell / 16 * 2] >> shift & kSquare;
    const uint64_t high = brick[cell / 16 * 2 + 1] >> shift & kSquare;
    cells.some |= uint64_t{(low | high) != 0} << cell;
    cells.all |= uint64_t{(low & high) == kSquare} << cell;
  }
  return cells;
}

/// The voxels of the cells whose bits are set.
Brick voxels_of(uint64_t cells) {
  Brick brick;
  for (int z = 0; z < kBrickEdge; ++z) {
    uint64_t layer = 0;
    for (int n = 0; n < 16; ++n) {
      if ((cells >> (z / 2 * 16 + n) & 1) != 0) {
        layer |= uint64_t{0x303} << (2 * (n % 4) + 16 * (n / 4));
      }
    }
    brick[z] = layer;
  }
  return brick;
}

/// Fills of the cells of a brick, with one layer of cells of the lower neighbours along each axis.
class CellWindow {
 public:
  static constexpr int kEdge = 5;
  static constexpr int at(int x, int y, int z) { return x + 1 + kEdge * (y + 1 + kEdge * (z + 1)); }

  /// sides[n]: the brick at (-(n & 1), -(n >> 1 & 1), -(n >> 2)); [0] is not used.
  explicit CellWindow(const std::array<Cells, 8>& sides) {
    for (int z = -1; z < 4; ++z) {
      for (int y = -1; y < 4; ++y) {
        const bool whole_row = z < 0 || y < 0;
        for (int x = -1; x < (whole_row ? 4 : 0); ++x) {
          const int side = int{x < 0} | int{y < 0} << 1 | int{z < 0} << 2;
          fills_[at(x, y, z)] = sides[side].at((x & 3) + 4 * (y & 3) + 16 * (z & 3));
        }
      }
    }
  }
  void set(int place, Fill fill) { fills_[place] = fill; }

  static constexpr int kContexts = 27 * 8;
  /// Context of a cell: fills of the three cells before it along the axes, and whether the three
  /// diagonal cells before it are not empty.
  int context(int place) const {
    constexpr int kX = 1, kY = kEdge, kZ = kEdge * kEdge;
    const auto fill = [&](int back) { return static_cast<int>(fills_[place - back]); };
    const auto some = [&](int back) {
      return static_cast<int>(fills_[place - back] != Fill::kEmpty);
    };
    const int faces = fill(kX) + 3 * fill(kY) + 9 * fill(kZ);
    return faces * 8 + some(kX + kY) + 2 * some(kX + kZ) + 4 * some(kY + kZ);
  }

 private:
  std::array<Fill, kEdge * kEdge * kEdge> fills_{};
};

/// State of a brick while voxels are coded.
struct KnownBrick {
  Brick occupied{};  ///< known occupied voxels
  Brick unknown{};
};

/// Codes one volume; `Coder` is RangeEncoder or RangeDecoder. The volume of the encoder is
/// complete; that of the decoder is filled step by step.
template <class Coder>
class OccupancyCode {
 public:
  OccupancyCode(Coder& coder, Occupancy& volume) : coder_(coder), volume_(volume) {}

  /// False when a limit or the end of the bytes was exceeded.
  bool run() {
    if (!code_bricks()) return false;
    cells_.resize(volume_.bricks.size());
    known_.assign(volume_.bricks.size(), {});
    for (size_t b = 0; b < cells_.size(); ++b) {
      if (fills_[b] == Fill::kMixed)
        code_cells(b);
      else
        cells_[b] = {~uint64_t{0}, ~uint64_t{0}};
      known_[b] = {voxels_of(cells_[b].all), voxels_of(cells_[b].some & ~cells_[b].all)};
      if (overran()) return false;
    }
    for (size_t b = 0; b < cells_.size(); ++b) {
      if (fills_[b] == Fill::kMixed) code_voxels(b);
      if (overran()) return false;
    }
    return true;
  }

 private:
  static constexpr bool kDecodes = std::is_same_v<Coder, RangeDecoder>;

  bool overran() const {
    if constexpr (kDecodes) return coder_.overran();
    return false;
  }

  Fill fill_of(BrickCoord at) const {
    const int index = volume_.occupied.index_of(at);
    if (index < 0) return Fill::kEmpty;
    return volume_.bricks[index] == kFullBrick ? Fill::kFull : Fill::kMixed;
  }

  bool code_bricks();
  void code_cells(size_t brick);
  void code_voxels(size_t brick);
  Cells cells_at(BrickCoord at) const {
    const int index = volume_.occupied.index_of(at);
    return index < 0 ? Cells{} : cells_[index];
  }
  const KnownBrick& known_at(BrickCoord at) const {
    static constexpr KnownBrick kNothing{};
    const int index = volume_.occupied.index_of(at);
    return index < 0 ? kNothing : known_[index];
  }

  Coder& coder_;
  Occupancy& volume_;
  std::vector<Fill> fills_;  ///< [brick] of volume_.bricks
  std::vector<Cells> cells_;
  std::vector<KnownBrick> known_;
  std::array<FillModel, 27> brick_models_;
  std::array<FillModel, CellWindow::kContexts> cell_models_;
  std::array<BitModel, 4096> voxel_models_;
};

template <class Coder>
bool OccupancyCode<Coder>::code_bricks() {
  const auto [nx, ny, nz] = volume_.counts();
  // The rows of this layer and of the one before, with an empty border at the low side.
  const size_t row = static_cast<size_t>(nx) + 1;
  const size_t layer = row * (static_cast<size_t>(ny) + 1);
  std::vector<Fill> before(layer, Fill::kEmpty), now(layer, Fill::kEmpty);
  for (int z = 0; z < nz; ++z, before.swap(now)) {
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) {
        const size_t place = (static_cast<size_t>(y) + 1) * row + x + 1;
        const int context = static_cast<int>(now[place - 1]) +
                            3 * static_cast<int>(now[place - row]) +
                            9 * static_cast<int>(before[place]);
        const BrickCoord at{x, y, z};
        const Fill fill =
            brick_models_[context].code(coder_, kDecodes ? Fill::kEmpty : fill_of(at));
        now[place] = fill;
        if (fill == Fill::kEmpty) continue;
        fills_.push_back(fill);
        if constexpr (kDecodes) {
          volume_.coords.push_back(at);
          volume_.occupied.word(at) |= BrickMap::bit(at);
        }
      }
      if (overran() || fills_.size() > Occupancy::kMaxBricks) return false;
    }
  }
  if constexpr (kDecodes) {
    volume_.occupied.number();
    volume_.bricks.assign(volume_.coords.size(), kFullBrick);
  }
  return true;
}

template <class Coder>
void OccupancyCode<Coder>::code_cells(size_t brick) {
  const BrickCoord at = volume_.coords[brick];
  std::array<Cells, 8> sides;
  for (int n = 1; n < 8; ++n) {
    sides[n] = cells_at({at.x - (n & 1), at.y - (n >> 1 & 1), at.z - (n >> 2)});
  }
  CellWindow window(sides);
  const Cells wanted = kDecodes ? Cells{} : cells_of(volume_.bricks[brick]);
  Cells& cells = cells_[brick];
  cells = {};
  for (int cell = 0; cell < 64; ++cell) {
    const int place = CellWindow::at(cell % 4, cell / 4 % 4, cell / 16);
    const Fill fill = cell_models_[window.context(place)].code(coder_, wanted.at(cell));
    window.set(place, fill);
    cells.some |= uint64_t{fill != Fill::kEmpty} << cell;
    cells.all |= uint64_t{fill == Fill::kFull} << cell;
  }
}

template <class Coder>
void OccupancyCode<Coder>::code_voxels(size_t brick) {
  const BrickCoord at = volume_.coords[brick];
  const auto side = [&](int x, int y, int z) -> const KnownBrick& {
    return known_at({at.x + x, at.y + y, at.z + z});
  };
  const KnownBrick &low_x = side(-1, 0, 0), &low_y = side(0, -1, 0), &low_z = side(0, 0, -1);
  const KnownBrick &low_xy = side(-1, -1, 0), &low_xz = side(-1, 0, -1), &low_yz = side(0, -1, -1);
  const KnownBrick &high_x = side(1, 0, 0), &high_y = side(0, 1, 0), &high_z = side(0, 0, 1);
  KnownBrick& own = known_[brick];
  for (int z = 0; z < kBrickEdge; ++z) {
    if (own.unknown[z] == 0) continue;
    const int above = (z + 1) % kBrickEdge;
    const int below = (z + 7) % kBrickEdge;
    const KnownBrick& at_above = z == 7 ? high_z : own;
    const Brick& at_below = (z == 0 ? low_z : own).occupied;
    const Brick& x_below = (z == 0 ? low_xz : low_x).occupied;
    const Brick& y_below = (z == 0 ? low_yz : low_y).occupied;
    // Known before this layer is coded.
    const std::array<uint64_t, 9> fixed{
        at_below[below],
        lower_x_neighbours(at_below[below], x_below[below]),
        lower_y_neighbours(at_below[below], y_below[below]),
        upper_x_neighbours(own.occupied[z], high_x.occupied[z]),
        upper_x_neighbours(own.unknown[z], high_x.unknown[z]),
        upper_y_neighbours(own.occupied[z], high_y.occupied[z]),
        upper_y_neighbours(own.unknown[z], high_y.unknown[z]),
        at_above.occupied[above],
        at_above.unknown[above],
    };
    uint64_t layer = own.occupied[z];
    // These are updated with each voxel of the layer.
    uint64_t from_x = lower_x_neighbours(layer, low_x.occupied[z]);
    uint64_t from_y = lower_y_neighbours(layer, low_y.occupied[z]);
    const uint64_t corner_row = lower_x_neighbours(low_y.occupied[z], low_xy.occupied[z]);
    uint64_t from_xy = lower_y_neighbours(from_x, corner_row);
    const uint64_t wanted = kDecodes ? 0 : volume_.bricks[brick][z];
    for (uint64_t remaining = own.unknown[z]; remaining != 0; remaining &= remaining - 1) {
      const int b = std::countr_zero(remaining);
      unsigned context = static_cast<unsigned>((from_x >> b & 1) | (from_y >> b & 1) << 1 |
                                               (from_xy >> b & 1) << 2);
      for (size_t n = 0; n < fixed.size(); ++n) {
        context |= static_cast<unsigned>(fixed[n] >> b & 1) << (3 + n);
      }
      const uint64_t voxel = coder_.bit(voxel_models_[context], (wanted >> b & 1) != 0) ? 1 : 0;
      layer |= voxel << b;
      const uint64_t beside = (voxel << b) << 1 & ~kColumnX0;
      from_x |= beside;
      from_y |= (voxel << b) << 8;
      from_xy |= beside << 8;
    }
    own.occupied[z] = layer;
    own.unknown[z] = 0;
  }
  if constexpr (kDecodes) volume_.bricks[brick] = own.occupied;
}

}  // namespace

void Occupancy::clear(const std::array<int, 3>& at, const std::array<int, 3>& size) {
  first = at;
  occupied.clear(size);
  occupied.number();
  bricks.clear();
  coords.clear();
}

bool Occupancy::box_fits(const std::array<int, 3>& size) {
  const int64_t rows = int64_t{size[1]} * size[2];
  const int words = (size[0] + BrickMap::kBitsPerWord - 1) / BrickMap::kBitsPerWord;
  return rows * size[0] <= kMaxBoxBricks && rows * words <= kMaxBoxWords;
}

bool Occupancy::assign(const BrickVolume& volume) {
  std::array<int, 3> low{}, size{};
  for (size_t n = 0; n < volume.coords.size(); ++n) {
    const BrickCoord c = volume.coords[n];
    const std::array<int, 3> at{c.x, c.y, c.z};
    for (int axis = 0; axis < 3; ++axis) {
      const int end = std::max(n == 0 ? 0 : low[axis] + size[axis], at[axis] + 1);
      low[axis] = n == 0 ? at[axis] : std::min(low[axis], at[axis]);
      size[axis] = end - low[axis];
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (low[axis] + size[axis] > kMaxAlongAxis) return false;
  }
  if (!box_fits(size) || volume.bricks.size() > kMaxBricks) return false;
  clear(low, size);
  for (const BrickCoord c : volume.coords) {
    coords.push_back({c.x - low[0], c.y - low[1], c.z - low[2]});
    occupied.word(coords.back()) |= BrickMap::bit(coords.back());
  }
  occupied.number();
  bricks.assign(volume.bricks.begin(), volume.bricks.end());
  return true;
}

std::vector<uint8_t> encode_occupancy(const Occupancy& volume) {
  RangeEncoder coder;
  Occupancy copy = volume;
  OccupancyCode(coder, copy).run();
  return coder.take();
}

bool decode_occupancy(std::span<const uint8_t> bytes, Occupancy& volume) {
  RangeDecoder coder(bytes);
  return OccupancyCode(coder, volume).run() && coder.ended();
}

}  // namespace v3d::codec
