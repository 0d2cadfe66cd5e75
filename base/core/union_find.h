// Union-find: disjoint sets of the integers 0 to count - 1.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace v3d {

/// Keeps its memory between uses. Use from one thread.
class UnionFind {
 public:
  /// Starts with `count` elements, each in a set of its own.
  void reset(size_t count) {
    parent_.resize(count);
    std::iota(parent_.begin(), parent_.end(), 0U);
  }

  /// Merges the sets of `a` and `b`. Returns false when they were one set already.
  bool unite(uint32_t a, uint32_t b) {
    a = find(a);
    b = find(b);
    if (a == b) return false;
    parent_[std::max(a, b)] = std::min(a, b);
    return true;
  }

  /// The smallest element of the set of `a`, which identifies the set.
  uint32_t find(uint32_t a) {
    while (parent_[a] != a) a = parent_[a] = parent_[parent_[a]];
    return a;
  }

 private:
  std::vector<uint32_t> parent_;  ///< never greater than the element itself
};

}  // namespace v3d
