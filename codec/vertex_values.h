// Values and indices of vertices, predicted from known vertices.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace v3d::codec {

// Known vertices: the neighbours with lower numbers, from which the values of a vertex are
// predicted.

/// Known vertices of all vertices. Values are coded in the order of the vertices, so a decoder
/// already has the values of lower numbers. Keeps its memory.
class KnownVertices {
 public:
  static constexpr int kMaxKnown = 4;
  using Four = std::span<const uint32_t, kMaxKnown>;

  /// Computes the known vertices. Requires indices below `vertices`.
  void make(std::span<const std::array<uint32_t, 3>> triangles, uint32_t vertices);

  uint32_t vertices() const { return static_cast<uint32_t>(known_.size()); }
  /// The vertices with lower numbers that share a triangle side, directed to `vertex`, with it: the
  /// first four in the order of triangles and sides. Fewer than four are repeated cyclically.
  /// Without any: the vertex before; for vertex 0 itself.
  Four of(uint32_t vertex) const { return std::span(known_[vertex].vertices).first<kMaxKnown>(); }

 private:
  struct Known {
    uint32_t count = 0;
    std::array<uint32_t, kMaxKnown + 1> vertices{};  ///< the last one receives surplus entries

    /// Repeats the entries until there are four; uses `otherwise` when there is none.
    void repeat(uint32_t otherwise) {
      constexpr std::array<std::array<uint8_t, kMaxKnown>, kMaxKnown + 1> kTurns{
          {{0, 0, 0, 0}, {0, 0, 0, 0}, {0, 1, 0, 1}, {0, 1, 2, 0}, {0, 1, 2, 3}}};
      const auto& turn = kTurns[count];
      const uint32_t first = count == 0 ? otherwise : vertices[0];
      vertices[0] = first;
      vertices = {first, vertices[turn[1]], vertices[turn[2]], vertices[turn[3]]};
    }
  };
  /// Adds `from` if it is lower than `to` and fewer than four are stored. Branch-free, because a
  /// branch would be mispredicted for half of the sides.
  void add(uint32_t from, uint32_t to) {
    Known& known = known_[to];
    known.vertices[known.count] = from;
    known.count +=
        static_cast<uint32_t>(from < to) & static_cast<uint32_t>(known.count < kMaxKnown);
  }

  std::vector<Known> known_;
};

// Lossless codec of three integers per vertex (displacement or position), predicted from
// neighbouring vertices.

/// The fourth is 0 and fills a vector register.
using VertexValues = std::array<int32_t, 4>;

/// Range of values. Requires -2^19 <= min <= 0 <= max < 2^19.
struct ValueRange {
  int min = 0, max = 0;
};

/// Requires values in `range` for all vertices of `known`.
std::vector<uint8_t> encode_values(std::span<const VertexValues> values, const KnownVertices& known,
                                   const ValueRange& range);

/// Returns the values by vertex. Empty when the bytes do not have exactly the length that an
/// encoder writes.
std::optional<std::vector<VertexValues>> decode_values(std::span<const uint8_t> bytes,
                                                       const KnownVertices& known,
                                                       const ValueRange& range);

// Class of the spread of the known values, which predicts the size of the next residual.

inline constexpr int kSpreadClasses = 6;

/// Returns 0 when the known values agree. Requires 0 <= spread, 1 <= step.
inline int spread_class(int spread, int step) {
  constexpr std::array<int, kSpreadClasses - 1> kBounds{1, 3, 6, 10, 16};  // half steps
  const int halves = 2 * spread / step;
  return static_cast<int>(std::count_if(kBounds.begin(), kBounds.end(),
                                        [halves](int bound) { return halves >= bound; }));
}

// Codec of triangle indices, for meshes that are not the surface of a volume.

/// Encodes triangles. Empty unless vertices are numbered in the order in which the triangles first
/// use them, and unused vertices come last.
std::optional<std::vector<uint8_t>> encode_triangles(
    std::span<const std::array<uint32_t, 3>> triangles, uint32_t vertices);

/// Decodes `triangles` triangles with indices below `vertices`. Empty when the bytes do not hold
/// exactly these.
std::optional<std::vector<std::array<uint32_t, 3>>> decode_triangles(std::span<const uint8_t> bytes,
                                                                     uint32_t triangles,
                                                                     uint32_t vertices);

// Lossless codec of one label for each vertex: to which performer it belongs.

/// Requires a label for each vertex of `known`.
std::vector<uint8_t> encode_labels(std::span<const uint8_t> labels, const KnownVertices& known);

/// Returns the labels by vertex. Empty when the bytes do not have exactly the length that an
/// encoder writes.
std::optional<std::vector<uint8_t>> decode_labels(std::span<const uint8_t> bytes,
                                                  const KnownVertices& known);

}  // namespace v3d::codec
