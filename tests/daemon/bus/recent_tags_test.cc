#include <gtest/gtest.h>

#include "daemon/bus/message_authenticator.h"

namespace v3d::bus {
namespace {

/// Tags with the same first two bytes lie in one set.
RecentTags::Tag tag(uint8_t set, uint8_t last) {
  RecentTags::Tag tag{};
  tag[1] = set;
  tag.back() = last;
  return tag;
}

TEST(RecentTags, contain_what_was_inserted_and_nothing_else) {
  RecentTags tags;
  tags.insert(tag(1, 7));
  EXPECT_TRUE(tags.contains(tag(1, 7)));
  EXPECT_FALSE(tags.contains(tag(1, 8)));
  EXPECT_FALSE(tags.contains(tag(2, 7)));
}

TEST(RecentTags, replace_the_oldest_tag_of_a_full_set) {
  RecentTags tags;
  for (uint8_t n = 0; n <= RecentTags::kWays; ++n) tags.insert(tag(1, static_cast<uint8_t>(n + 1)));
  EXPECT_FALSE(tags.contains(tag(1, 1)));
  for (uint8_t n = 1; n <= RecentTags::kWays; ++n) {
    EXPECT_TRUE(tags.contains(tag(1, static_cast<uint8_t>(n + 1))));
  }
}

}  // namespace
}  // namespace v3d::bus
