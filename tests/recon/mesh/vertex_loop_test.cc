#include <gtest/gtest.h>

#include <mutex>
#include <numeric>
#include <utility>
#include <vector>

#include "recon/mesh/mesh_neighbours.h"

namespace v3d::recon {
namespace {

constexpr size_t kCounts[] = {0, 1, 63, 64, 65, 511, 512, 513, 5000};

TEST(VertexLoop, visits_each_vertex_once) {
  for (const size_t count : kCounts) {
    std::vector<int> visits(count + 1, 0);
    for_each_vertex(count, [&](size_t v) { ++visits[v]; });
    std::vector<int> expected(count, 1);
    expected.push_back(0);
    EXPECT_EQ(visits, expected) << count;
  }
}

TEST(VertexLoop, divides_the_indices_into_blocks_that_begin_at_multiples_of_their_size) {
  for (const size_t count : kCounts) {
    std::mutex mutex;
    std::vector<std::pair<size_t, size_t>> blocks;
    for_each_block<64>(count, [&](size_t begin, size_t end) {
      const std::lock_guard lock(mutex);
      blocks.emplace_back(begin, end);
    });
    std::sort(blocks.begin(), blocks.end());
    size_t next = 0;
    for (const auto& [begin, end] : blocks) {
      EXPECT_EQ(begin, next) << count;
      EXPECT_EQ(end, std::min(count, begin + 64)) << count;
      next = end;
    }
    EXPECT_EQ(next, count);
  }
}

}  // namespace
}  // namespace v3d::recon
