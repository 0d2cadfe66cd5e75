#include "daemon/recond/reorder_buffer.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <set>

namespace v3d {
namespace {

MeshMessage mesh(int64_t pulse, size_t bytes = 1) {
  MeshMessage mesh;
  mesh.pulse = pulse;
  mesh.compact.assign(bytes, 0);
  return mesh;
}

RC_GTEST_PROP(ReorderBuffer, gives_out_every_pulse_once_and_in_order, ()) {
  const auto first = *rc::gen::inRange<int64_t>(0, 50);
  const auto pulses =
      *rc::gen::container<std::vector<int64_t>>(rc::gen::inRange<int64_t>(first, first + 40));
  ReorderBuffer order(first);
  std::set<int64_t> added;
  std::vector<int64_t> given;
  const auto take = [&] {
    while (const auto next = order.take()) given.push_back(next->pulse);
  };
  for (const int64_t pulse : pulses) {
    RC_ASSERT(order.add(mesh(pulse)) == added.insert(pulse).second);
    take();
  }
  while (order.next() < first + 40) {
    order.pass_over();
    take();
  }
  RC_ASSERT(given == std::vector<int64_t>(added.begin(), added.end()));
}

TEST(ReorderBuffer, has_nothing_to_do_with_what_was_before_its_first) {
  ReorderBuffer order(5);
  EXPECT_FALSE(order.add(mesh(4)));
  EXPECT_TRUE(order.add(mesh(5)));
  EXPECT_EQ(order.take()->pulse, 5);
  EXPECT_FALSE(order.add(mesh(5))) << "the stream is past it";
}

TEST(ReorderBuffer, is_full_of_meshes_or_of_bytes_and_has_room_again) {
  ReorderBuffer order(0, {.meshes = 2, .bytes = 100});
  order.add(mesh(1));
  EXPECT_FALSE(order.is_full());
  order.add(mesh(2));
  EXPECT_TRUE(order.is_full()) << "of meshes";
  order.pass_over();
  order.take();
  order.take();
  EXPECT_FALSE(order.is_full());
  order.add(mesh(4, 100));
  EXPECT_TRUE(order.is_full()) << "of bytes";
}

}  // namespace
}  // namespace v3d
