// Which of many numbered things belong together (union-find).
#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace v3d {

/// Keeps its memory when it starts again. One thread.
class UnionFind {
 public:
  /// `count` things, each in a set of its own.
  void reset(size_t count) {
    parent_.resize(count);
    std::iota(parent_.begin(), parent_.end(), 0U);
  }

  void unite(uint32_t a, uint32_t b) {
    a = find(a);
    b = find(b);
    if (a < b) {
      parent_[b] = a;
    } else {
      parent_[a] = b;
    }
  }

  /// The least member of the set that `a` is in: the set's name.
  uint32_t find(uint32_t a) {
    while (parent_[a] != a) a = parent_[a] = parent_[parent_[a]];
    return a;
  }

 private:
  std::vector<uint32_t> parent_;  ///< never greater than the thing itself
};

}  // namespace v3d
