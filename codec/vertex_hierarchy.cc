#include "codec/vertex_hierarchy.h"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <optional>
#include <utility>

#include "codec/check.h"

namespace v3d::codec {
namespace {

using Triangle = std::array<uint32_t, 3>;

/// A vertex with more neighbours takes over no removed vertex. It bounds the time for hostile
/// meshes.
constexpr size_t kMaxMerged = 24;

/// Graph of the edges of a mesh from which vertices are removed.
class EdgeGraph {
 public:
  EdgeGraph(std::span<const Triangle> triangles, uint32_t vertices)
      : adjacent_(vertices), removed_(vertices) {
    for (const Triangle& t : triangles) {
      for (int side = 0; side < 3; ++side) connect(t[side], t[(side + 1) % 3]);
    }
    for (auto& list : adjacent_) {
      std::sort(list.begin(), list.end());
      list.erase(std::unique(list.begin(), list.end()), list.end());
    }
  }

  bool removed(uint32_t vertex) const { return removed_[vertex]; }
  /// May contain removed vertices until clean().
  const std::vector<uint32_t>& list(uint32_t vertex) const { return adjacent_[vertex]; }

  /// Removes a vertex and connects its neighbours to that with the shortest list, the first of
  /// several. Requires that no neighbour was removed since clean(). False, without a change, when
  /// all lists are too long.
  bool remove(uint32_t vertex) {
    const std::vector<uint32_t>& ring = adjacent_[vertex];
    const uint32_t heir = *std::min_element(ring.begin(), ring.end(), [&](uint32_t a, uint32_t b) {
      return adjacent_[a].size() < adjacent_[b].size();
    });
    if (adjacent_[heir].size() > kMaxMerged) return false;
    for (const uint32_t other : ring) {
      const auto& known = adjacent_[heir];
      if (other == heir || std::find(known.begin(), known.end(), other) != known.end()) continue;
      adjacent_[heir].push_back(other);
      adjacent_[other].push_back(heir);
    }
    removed_[vertex] = true;
    return true;
  }

  /// Deletes removed vertices from all lists.
  void clean() {
    for (auto& list : adjacent_) {
      list.erase(std::remove_if(list.begin(), list.end(), [&](uint32_t v) { return removed_[v]; }),
                 list.end());
    }
  }

 private:
  void connect(uint32_t a, uint32_t b) {
    if (a == b) return;
    adjacent_[a].push_back(b);
    adjacent_[b].push_back(a);
  }

  std::vector<std::vector<uint32_t>> adjacent_;
  std::vector<bool> removed_;
};

using Offset = std::array<int64_t, 3>;
using Symmetric = std::array<int64_t, 6>;  ///< xx, xy, xz, yy, yz, zz

/// A point and its neighbours, relative to the mean of the neighbours, scaled to 8 bits.
struct Neighbourhood {
  std::array<Offset, VertexHierarchy::kMaxNeighbours> neighbours{};
  size_t count = 0;
  Offset point{};
};

/// Empty when all offsets are 0.
std::optional<Neighbourhood> neighbourhood_of(std::span<const LatticePosition> positions,
                                              uint32_t vertex,
                                              std::span<const uint32_t> neighbours) {
  Neighbourhood n;
  n.count = neighbours.size();
  const auto count = static_cast<int64_t>(n.count);
  int64_t greatest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    int64_t sum = 0;
    for (const uint32_t other : neighbours) sum += positions[other][axis];
    const auto offset = [&](uint32_t of) {
      const int64_t value = count * positions[of][axis] - sum;
      greatest = std::max(greatest, std::abs(value));
      return value;
    };
    for (size_t i = 0; i < n.count; ++i) n.neighbours[i][axis] = offset(neighbours[i]);
    n.point[axis] = offset(vertex);
  }
  if (greatest == 0) return std::nullopt;
  const int shift = std::bit_width(static_cast<uint64_t>(greatest)) - 8;
  const auto scale = [shift](Offset& offset) {
    for (int64_t& value : offset) {
      value = shift > 0 ? value >> shift : value * (int64_t{1} << -shift);
    }
  };
  for (size_t i = 0; i < n.count; ++i) scale(n.neighbours[i]);
  scale(n.point);
  return n;
}

/// Sum of the outer products of the neighbours, with 1/32 of its trace added to the diagonal.
Symmetric regularised_scatter(const Neighbourhood& n) {
  Symmetric m{};
  for (size_t i = 0; i < n.count; ++i) {
    const auto& [x, y, z] = n.neighbours[i];
    m[0] += x * x;
    m[1] += x * y;
    m[2] += x * z;
    m[3] += y * y;
    m[4] += y * z;
    m[5] += z * z;
  }
  const int64_t added = (m[0] + m[3] + m[5]) / 32 + 1;
  for (const int diagonal : {0, 3, 5}) m[diagonal] += added;
  return m;
}

/// The weights of least norm, in units of 1/kOne; empty when they are too large. Offsets have at
/// most 8 bits and there are at most 8 neighbours, so that no product exceeds 62 bits.
std::optional<std::array<int16_t, VertexHierarchy::kMaxNeighbours>> affine_weights(
    const Neighbourhood& n) {
  const auto [xx, xy, xz, yy, yz, zz] = regularised_scatter(n);
  const Symmetric inverse{yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy,
                          xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy};
  const int64_t scale =
      (xx * inverse[0] + xy * inverse[1] + xz * inverse[2]) >> VertexHierarchy::kWeightBits;
  if (scale <= 0) return std::nullopt;
  const auto& [a, b, c, d, e, f] = inverse;
  const auto& [x, y, z] = n.point;
  const Offset solved{a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z};
  std::array<int16_t, VertexHierarchy::kMaxNeighbours> weights{};
  int64_t remaining = VertexHierarchy::kOne;
  for (size_t i = 0; i < n.count; ++i) {
    const auto& p = n.neighbours[i];
    const int64_t weight = VertexHierarchy::kOne / static_cast<int64_t>(n.count) +
                           (p[0] * solved[0] + p[1] * solved[1] + p[2] * solved[2]) / scale;
    if (std::abs(weight) > 2 * VertexHierarchy::kOne) return std::nullopt;
    weights[i] = static_cast<int16_t>(weight);
    remaining -= weight;
  }
  remaining += weights[0];
  if (std::abs(remaining) > 2 * VertexHierarchy::kOne) return std::nullopt;
  weights[0] = static_cast<int16_t>(remaining);
  return weights;
}

}  // namespace

VertexHierarchy::VertexHierarchy(std::span<const Triangle> triangles, uint32_t vertices)
    : levels_(vertices, kMaxLevels) {
  EdgeGraph graph(triangles, vertices);
  std::vector<std::vector<uint32_t>> rings(vertices);
  std::vector<uint8_t> blocked(vertices);
  for (uint8_t level = 0; level < kMaxLevels; ++level) {
    std::fill(blocked.begin(), blocked.end(), uint8_t{0});
    bool some = false;
    for (uint32_t v = vertices; v-- > 0;) {
      const std::vector<uint32_t>& ring = graph.list(v);
      if (graph.removed(v) || blocked[v] || ring.empty() || ring.size() > kMaxNeighbours) continue;
      std::vector<uint32_t> neighbours = ring;
      if (!graph.remove(v)) continue;
      for (const uint32_t other : neighbours) blocked[other] = 1;
      rings[v] = std::move(neighbours);
      levels_[v] = level;
      order_.push_back(v);
      some = true;
    }
    if (!some) break;
    graph.clean();
  }
  for (uint32_t v = vertices; v-- > 0;) {
    if (!graph.removed(v)) order_.push_back(v);
  }
  std::reverse(order_.begin(), order_.end());

  for (size_t i = 1; i < order_.size() && rings[order_[i]].empty(); ++i) {
    rings[order_[i]] = {order_[i - 1]};
  }
  first_.reserve(vertices + size_t{1});
  first_.push_back(0);
  for (const auto& ring : rings) {
    neighbours_.insert(neighbours_.end(), ring.begin(), ring.end());
    first_.push_back(static_cast<uint32_t>(neighbours_.size()));
    for (size_t i = 0; i < ring.size(); ++i) {
      const auto count = static_cast<int>(ring.size());
      weights_.push_back(static_cast<int16_t>(kOne / count + (i == 0 ? kOne % count : 0)));
    }
  }
}

void VertexHierarchy::fit_weights(std::span<const LatticePosition> positions) {
  V3D_CODEC_CHECK(positions.size() == levels_.size());
  for (uint32_t v = 0; v < levels_.size(); ++v) {
    if (neighbours(v).size() < 2) continue;
    const auto around = neighbourhood_of(positions, v, neighbours(v));
    const auto fitted = around ? affine_weights(*around) : std::nullopt;
    if (!fitted) continue;
    std::copy_n(fitted->begin(), neighbours(v).size(), weights_.begin() + first_[v]);
  }
}

namespace {

/// Moves bit n of the lowest 21 bits to bit 3 n.
uint64_t spread(uint32_t number) {
  uint64_t bits = number & 0x1FFFFF;
  bits = (bits | bits << 32) & 0x001F00000000FFFF;
  bits = (bits | bits << 16) & 0x001F0000FF0000FF;
  bits = (bits | bits << 8) & 0x100F00F00F00F00F;
  bits = (bits | bits << 4) & 0x10C30C30C30C30C3;
  bits = (bits | bits << 2) & 0x1249249249249249;
  return bits;
}

/// A subtree that still lacks its high sibling.
struct Open {
  uint32_t low;
  uint64_t difference;  ///< exclusive or of the codes at the border to the sibling
};

}  // namespace

uint64_t morton_code(uint32_t x, uint32_t y, uint32_t z) {
  return spread(x) | spread(y) << 1 | spread(z) << 2;
}

VertexTree::VertexTree(std::span<const uint64_t> codes)
    : vertices_(static_cast<uint32_t>(codes.size())) {
  if (vertices_ == 0) return;
  std::vector<std::pair<uint64_t, uint32_t>> sorted(vertices_);
  for (uint32_t v = 0; v < vertices_; ++v) sorted[v] = {codes[v], v};
  std::sort(sorted.begin(), sorted.end());
  nodes_.reserve(vertices_ - 1);
  std::vector<Open> open;
  uint32_t subtree = sorted[0].second;
  const auto join = [&] {
    nodes_.push_back({open.back().low, subtree});
    subtree = vertices_ + static_cast<uint32_t>(nodes_.size()) - 1;
    open.pop_back();
  };
  for (size_t n = 1; n < sorted.size(); ++n) {
    const uint64_t difference = sorted[n - 1].first ^ sorted[n].first;
    while (!open.empty() && open.back().difference < difference) join();
    open.push_back({subtree, difference});
    subtree = sorted[n].second;
  }
  while (!open.empty()) join();
}

}  // namespace v3d::codec
