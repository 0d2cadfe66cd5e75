// Known vertices: the neighbours with lower numbers, from which the values of a vertex are
// predicted.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace v3d {

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

}  // namespace v3d
