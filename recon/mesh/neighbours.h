// Which vertices of a mesh an edge joins.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/mesh.h"

namespace v3d {

/// The neighbours of every vertex of a closed mesh, each once. Immutable; any thread.
class Neighbours {
 public:
  Neighbours() = default;
  explicit Neighbours(const Mesh& mesh);
  size_t size() const { return first_.empty() ? 0 : first_.size() - 1; }  ///< vertices
  std::span<const uint32_t> of(size_t vertex) const {
    return {list_.data() + first_[vertex], first_[vertex + 1] - first_[vertex]};
  }

 private:
  std::vector<uint32_t> first_, list_;
};

}  // namespace v3d
