#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <set>

#include "daemon/recond/shard_members.h"

namespace v3d::recond {
namespace {

wire::MeshMessage mesh(int64_t pulse, size_t bytes = 1) {
  wire::MeshMessage mesh;
  mesh.pulse = pulse;
  mesh.compact.assign(bytes, 0);
  return mesh;
}

RC_GTEST_PROP(ReorderBuffer, returns_every_pulse_once_and_in_order, ()) {
  const auto first = *rc::gen::inRange<int64_t>(0, 50);
  const auto pulses =
      *rc::gen::container<std::vector<int64_t>>(rc::gen::inRange<int64_t>(first, first + 40));
  ReorderBuffer buffer(first);
  std::set<int64_t> added;
  std::vector<int64_t> returned;
  const auto pop_all = [&] {
    while (const auto next = buffer.pop()) returned.push_back(next->pulse);
  };
  for (const int64_t pulse : pulses) {
    RC_ASSERT(buffer.add(mesh(pulse)) == added.insert(pulse).second);
    pop_all();
  }
  while (buffer.next() < first + 40) {
    buffer.skip();
    pop_all();
  }
  RC_ASSERT(returned == std::vector<int64_t>(added.begin(), added.end()));
}

TEST(ReorderBuffer, rejects_pulses_before_its_first) {
  ReorderBuffer buffer(5);
  EXPECT_FALSE(buffer.add(mesh(4)));
  EXPECT_TRUE(buffer.add(mesh(5)));
  EXPECT_EQ(buffer.pop()->pulse, 5);
  EXPECT_FALSE(buffer.add(mesh(5))) << "before next()";
}

TEST(ReorderBuffer, has_limits_of_meshes_and_of_bytes) {
  ReorderBuffer buffer(0, {.meshes = 2, .bytes = 100});
  buffer.add(mesh(1));
  EXPECT_FALSE(buffer.is_full());
  buffer.add(mesh(2));
  EXPECT_TRUE(buffer.is_full()) << "of meshes";
  buffer.skip();
  buffer.pop();
  buffer.pop();
  EXPECT_FALSE(buffer.is_full());
  buffer.add(mesh(4, 100));
  EXPECT_TRUE(buffer.is_full()) << "of bytes";
}

}  // namespace
}  // namespace v3d::recond
