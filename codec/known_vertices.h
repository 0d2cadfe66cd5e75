// What the values of a vertex are predicted from: its neighbours with lower numbers.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace v3d {

/// Values are coded in the order of the vertices, so those with lower numbers are known. Keeps its
/// memory.
class KnownVertices {
 public:
  static constexpr int kMost = 4;
  using Four = std::span<const uint32_t, kMost>;

  /// Requires indices below `vertices`.
  void make(std::span<const std::array<uint32_t, 3>> triangles, uint32_t vertices);

  uint32_t vertices() const { return static_cast<uint32_t>(known_.size()); }
  /// The vertices with lower numbers from which the side of a triangle runs to `vertex`: the first
  /// four in the order of the triangles and their sides. Fewer than four are repeated in turn.
  /// Where there are none, the vertex before; for vertex 0 itself.
  Four of(uint32_t vertex) const { return std::span(known_[vertex].vertices).first<kMost>(); }

 private:
  struct Known {
    uint32_t count = 0;
    std::array<uint32_t, kMost + 1> vertices{};  ///< the last one takes what is too much

    /// Until there are four; `otherwise` where there is none.
    void repeat(uint32_t otherwise) {
      constexpr std::array<std::array<uint8_t, kMost>, kMost + 1> kTurns{
          {{0, 0, 0, 0}, {0, 0, 0, 0}, {0, 1, 0, 1}, {0, 1, 2, 0}, {0, 1, 2, 3}}};
      const auto& turn = kTurns[count];
      const uint32_t first = count == 0 ? otherwise : vertices[0];
      vertices[0] = first;
      vertices = {first, vertices[turn[1]], vertices[turn[2]], vertices[turn[3]]};
    }
  };
  /// Without a branch: half of the sides run upwards.
  void add(uint32_t from, uint32_t to) {
    Known& known = known_[to];
    known.vertices[known.count] = from;
    known.count += static_cast<uint32_t>(from < to) & static_cast<uint32_t>(known.count < kMost);
  }

  std::vector<Known> known_;
};

}  // namespace v3d
