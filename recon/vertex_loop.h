// A loop over the vertices of a mesh on all threads.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>

namespace v3d {

/// Calls work(v) for each v below `count`, in blocks; each call writes only what belongs to v.
template <class Work>
void for_each_vertex(size_t count, const Work& work) {
  constexpr size_t kBlock = 512;
  tbb::parallel_for(size_t{0}, (count + kBlock - 1) / kBlock, [&](size_t block) {
    const size_t end = std::min(count, (block + 1) * kBlock);
    for (size_t v = block * kBlock; v < end; ++v) work(v);
  });
}

}  // namespace v3d
