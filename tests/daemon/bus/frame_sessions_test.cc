#include <gtest/gtest.h>

#include "daemon/bus/frame_keys.h"
#include "wire/datagram_mac.h"

namespace v3d::bus {
namespace {

using namespace std::chrono_literals;

constexpr MonotonicInstant kNow = from_ns<Monotonic>(3'600'000'000'000);

class FrameSessionsTest : public testing::Test {
 protected:
  uint32_t announce(const std::string& node, uint32_t number, Duration after = {}) {
    return sessions_.announce(node, number, {}, kNow + after, [] { return nullptr; });
  }
  bool has(uint32_t number, Duration after) const { return sessions_.has(number, kNow + after); }

  FrameSessions sessions_;
};

TEST_F(FrameSessionsTest, keep_the_previous_session_of_a_node_for_two_seconds) {
  announce("cap01", 7);
  EXPECT_TRUE(has(7, 1h)) << "it remains until there is another";
  announce("cap01", 8, 10s);
  announce("cap01", 8, 11s);
  EXPECT_TRUE(has(7, 12s - 1ms));
  EXPECT_FALSE(has(7, 12s));
  EXPECT_TRUE(has(8, 12s));
  announce("cap01", 8, 12s);
  EXPECT_EQ(sessions_.size(), 1U) << "the key is erased";
}

TEST_F(FrameSessionsTest, are_two_at_most_for_each_node) {
  announce("cap02", 1);
  for (uint32_t number = 7; number < 20; ++number) announce("cap01", number);
  EXPECT_EQ(sessions_.size(), 3U);
  EXPECT_TRUE(has(18, 1s));
  EXPECT_TRUE(has(19, 1s));
  EXPECT_TRUE(has(1, 1s)) << "of another node";
}

TEST_F(FrameSessionsTest, become_the_newest_again_when_they_are_announced_again) {
  const uint32_t id = announce("cap01", 7);
  announce("cap01", 8);
  EXPECT_EQ(announce("cap01", 7, 1s), id);
  EXPECT_TRUE(has(7, 1h));
  EXPECT_FALSE(has(8, 3s));
}

TEST_F(FrameSessionsTest, with_one_number_are_separate_for_each_node) {
  const uint32_t first = announce("cap01", 7);
  const uint32_t second = announce("cap02", 7);
  EXPECT_NE(first, second);
  EXPECT_EQ(sessions_.find(7).size(), 2U);
  EXPECT_EQ(announce("cap01", 7), first);
}

TEST_F(FrameSessionsTest, are_64_at_most_and_the_one_announced_longest_ago_is_removed) {
  for (uint32_t i = 0; i < FrameSessions::kMaxSessions; ++i) {
    announce("cap" + std::to_string(i), 1000 - i, i * 1ms);
  }
  announce("cap0", 1000, 1s);
  announce("another", 5, 2s);
  EXPECT_EQ(sessions_.size(), FrameSessions::kMaxSessions);
  EXPECT_TRUE(has(1000, 2s));
  EXPECT_FALSE(has(999, 2s));
  EXPECT_TRUE(has(998, 2s));
  EXPECT_TRUE(has(5, 2s));
}

TEST_F(FrameSessionsTest, open_a_key_once) {
  int opened = 0;
  const auto announce_with_key = [&](bool has_key) {
    sessions_.announce("cap01", 7, {}, kNow, [&]() -> std::shared_ptr<const wire::DatagramMac> {
      ++opened;
      return has_key ? std::make_shared<const wire::DatagramMac>(wire::FrameKey::make().mac())
                     : nullptr;
    });
  };
  announce_with_key(false);
  EXPECT_EQ(sessions_.find(7)[0].mac, nullptr);
  announce_with_key(true);
  announce_with_key(true);
  EXPECT_NE(sessions_.find(7)[0].mac, nullptr);
  EXPECT_EQ(opened, 2);
}

}  // namespace
}  // namespace v3d::bus
