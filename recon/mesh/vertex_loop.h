// Parallel loops over the vertices of a mesh.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>

namespace v3d {

/// Calls work(begin, end) for consecutive blocks of kBlock indices below `count`, in parallel. A
/// call may write only data of its own block.
template <size_t kBlock, class Work>
void for_each_block(size_t count, const Work& work) {
  tbb::parallel_for(size_t{0}, (count + kBlock - 1) / kBlock, [&](size_t block) {
    work(block * kBlock, std::min(count, (block + 1) * kBlock));
  });
}

/// Calls work(v) for each v below `count`, in parallel. A call may write only data of v.
template <class Work>
void for_each_vertex(size_t count, const Work& work) {
  for_each_block<512>(count, [&](size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v) work(v);
  });
}

}  // namespace v3d
