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

  /// Requires indices below `vertices`.
  void make(std::span<const std::array<uint32_t, 3>> triangles, uint32_t vertices);

  uint32_t vertices() const { return static_cast<uint32_t>(known_.size()); }
  /// The vertices with lower numbers from which the side of a triangle runs to `vertex`: the first
  /// four in the order of the triangles and their sides. Where there are none, the vertex before;
  /// for vertex 0 none.
  std::span<const uint32_t> of(uint32_t vertex) const {
    return {known_[vertex].vertices.data(), known_[vertex].count};
  }

 private:
  struct Known {
    uint32_t count = 0;
    std::array<uint32_t, kMost + 1> vertices{};  ///< the last one takes what is too much
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
