#include "codec/vertex_tree.h"

#include <algorithm>
#include <utility>

namespace v3d::codec {
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
