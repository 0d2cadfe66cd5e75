#include <gtest/gtest.h>

#include <vector>

#include "base/core/bytes.h"

namespace v3d {
namespace {

TEST(Checksum, returns_the_xxh3_of_no_bytes) { EXPECT_EQ(checksum({}), 0x2D06800538D394C2); }

TEST(Checksum, matches_the_reference_xxh3_of_a_megabyte) {
  std::vector<uint8_t> bytes(1 << 20);
  for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<uint8_t>(i % 251);
  EXPECT_EQ(checksum({bytes}), 0x6E0D7AC36B8C10FF);
}

TEST(Checksum, does_not_depend_on_where_the_parts_are_cut) {
  std::vector<uint8_t> bytes(1000);
  for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<uint8_t>(7 * i);
  const std::span<const uint8_t> whole(bytes);
  for (const size_t cut : {size_t{0}, size_t{1}, size_t{255}, size_t{999}, size_t{1000}}) {
    EXPECT_EQ(checksum({whole.first(cut), whole.subspan(cut)}), checksum({whole})) << cut;
  }
}

TEST(RunningChecksum, equals_the_checksum_of_all_bytes_added_so_far) {
  const std::vector<uint8_t> bytes = {1, 2, 3, 4, 5};
  const std::span<const uint8_t> whole(bytes);
  RunningChecksum running;
  EXPECT_EQ(running.value(), checksum({}));
  running.add(whole.first(2));
  EXPECT_EQ(running.value(), checksum({whole.first(2)}));
  RunningChecksum moved = std::move(running);
  moved.add(whole.subspan(2));
  EXPECT_EQ(moved.value(), checksum({whole}));
}

}  // namespace
}  // namespace v3d
