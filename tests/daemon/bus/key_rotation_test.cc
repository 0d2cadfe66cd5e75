#include <gtest/gtest.h>

#include <memory>

#include "daemon/bus/credentials.h"

namespace v3d::bus {
namespace {

using namespace std::chrono_literals;

constexpr MonotonicInstant kNow = from_ns<Monotonic>(3'600'000'000'000);
using Rotation = KeyRotation<int>;

TEST(KeyRotation, has_no_key_at_first) {
  const Rotation keys;
  EXPECT_FALSE(keys.has_key());
  EXPECT_EQ(keys.sending(kNow), nullptr);
  EXPECT_EQ(keys.newest(), nullptr);
  EXPECT_EQ(keys.old(kNow), nullptr);
}

TEST(KeyRotation, uses_the_first_key_at_once) {
  Rotation keys;
  keys.set(1, kNow);
  EXPECT_EQ(*keys.sending(kNow), 1);
  EXPECT_EQ(*keys.newest(), 1);
  EXPECT_EQ(keys.old(kNow), nullptr);
}

TEST(KeyRotation, sends_with_the_old_key_for_ten_seconds_and_accepts_it_for_twenty) {
  Rotation keys;
  keys.set(1, kNow);
  const MonotonicInstant replaced = kNow + 1h;
  keys.set(2, replaced);
  EXPECT_EQ(*keys.newest(), 2);
  EXPECT_EQ(*keys.sending(replaced + Rotation::kSendOld - 1ns), 1);
  EXPECT_EQ(*keys.sending(replaced + Rotation::kSendOld), 2);
  EXPECT_EQ(*keys.old(replaced + Rotation::kAcceptOld - 1ns), 1);
  EXPECT_EQ(keys.old(replaced + Rotation::kAcceptOld), nullptr);
}

TEST(KeyRotation, loses_no_message_between_processes_that_get_the_key_within_ten_seconds) {
  for (const Duration delay : {0s, 5s, 9s}) {
    Rotation first, second;
    first.set(1, kNow);
    second.set(1, kNow);
    bool second_has_it = false;
    first.set(2, kNow);
    const auto accepts = [](const Rotation& keys, int key, MonotonicInstant now) {
      return *keys.newest() == key || (keys.old(now) != nullptr && *keys.old(now) == key);
    };
    for (Duration t{}; t < 40s; t += 100ms) {
      const MonotonicInstant now = kNow + t;
      if (t >= delay && !second_has_it) second.set(2, now);
      second_has_it = t >= delay;
      EXPECT_TRUE(accepts(second, *first.sending(now), now)) << to_seconds(t);
      EXPECT_TRUE(accepts(first, *second.sending(now), now)) << to_seconds(t);
    }
  }
}

TEST(KeyRotation, invalidates_the_first_key_with_the_third) {
  Rotation keys;
  keys.set(1, kNow);
  keys.set(2, kNow + 1s);
  keys.set(3, kNow + 2s);
  EXPECT_EQ(*keys.old(kNow + 3s), 2);
  EXPECT_EQ(*keys.sending(kNow + 3s), 2);
}

TEST(KeyRotation, releases_the_old_key_when_its_time_is_over_and_not_before) {
  KeyRotation<std::shared_ptr<int>> keys;
  const auto old = std::make_shared<int>(1);
  keys.set(old, kNow);
  keys.set(std::make_shared<int>(2), kNow);
  keys.discard_old(kNow + Rotation::kAcceptOld - 1ns);
  EXPECT_EQ(old.use_count(), 2);
  keys.discard_old(kNow + Rotation::kAcceptOld);
  EXPECT_EQ(old.use_count(), 1);
}

}  // namespace
}  // namespace v3d::bus
