#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <limits>
#include <set>

#include "daemon/control/reply_json.h"

namespace v3d::control {
namespace {

using Numbers = std::vector<int64_t>;

TEST(PackedNumbers, are_runs_or_bits_whichever_is_shorter) {
  EXPECT_EQ(pack_numbers({}), "");
  EXPECT_EQ(pack_numbers({7}), "7");
  EXPECT_EQ(pack_numbers({0, 1, 2, 300}), "0:2 300");
  EXPECT_EQ(pack_numbers({0, 2, 4, 6, 8, 10, 12, 14, 16}), "bits 0 VVUB");
}

RC_GTEST_PROP(PackedNumbers, are_unpacked_to_the_same_numbers, (const std::set<int64_t>& any)) {
  const int64_t base =
      *rc::gen::element<int64_t>(std::numeric_limits<int64_t>::min(), 0, 1'000'000);
  std::set<int64_t> dense;
  for (const int64_t number : *rc::gen::container<std::vector<int64_t>>(rc::gen::inRange(0, 200))) {
    dense.insert(base + number);
  }
  for (const auto& set : {any, dense}) {
    const Numbers numbers(set.begin(), set.end());
    RC_ASSERT(unpack_numbers(pack_numbers(numbers), numbers.size()) == numbers);
    RC_ASSERT(numbers.empty() || !unpack_numbers(pack_numbers(numbers), numbers.size() - 1));
  }
}

RC_GTEST_PROP(PackedNumbers, keep_their_order, (const Numbers& numbers)) {
  RC_ASSERT(unpack_numbers(pack_numbers(numbers), numbers.size()) == numbers);
}

TEST(PackedNumbers, of_any_pattern_take_at_most_a_sixth_of_a_character_for_each_pulse) {
  constexpr int64_t kPulses = 100'000;
  for (const int64_t step : {1, 2, 3, 5, 17}) {
    Numbers numbers;
    for (int64_t pulse = 0; pulse < kPulses; pulse += step) numbers.push_back(pulse);
    EXPECT_LE(pack_numbers(numbers).size(), kPulses / 6 + 30) << step;
  }
}

TEST(PackedNumbers, with_numbers_at_the_limits_of_their_type_are_unpacked) {
  constexpr int64_t kMax = std::numeric_limits<int64_t>::max();
  constexpr int64_t kMin = std::numeric_limits<int64_t>::min();
  for (const Numbers& numbers :
       {Numbers{kMax - 16, kMax - 14, kMax - 12, kMax - 10, kMax - 8, kMax - 2, kMax},
        Numbers{kMax - 1, kMax}, Numbers{kMin, kMax}, Numbers{kMin, kMin + 2, kMin + 4}}) {
    EXPECT_EQ(unpack_numbers(pack_numbers(numbers), 10), numbers);
  }
}

TEST(PackedNumbers, reject_other_texts) {
  for (const char* text :
       {" ", "1 ", " 1", "1,2", "3:2", "1:", ":1", "1:2:3", "a", "99999999999999999999", "bits",
        "bits 1", "bits  VVUB", "bits 0 VVU", "bits 0 !!!!", "bits 9223372036854775807 VVUB",
        "0:18446744073709551615"}) {
    EXPECT_FALSE(unpack_numbers(text, 1000)) << text;
  }
}

TEST(PackedNumbers, reject_more_numbers_than_the_limit) {
  EXPECT_FALSE(unpack_numbers("0:9223372036854775807", 1'000'000));
  EXPECT_FALSE(unpack_numbers("0:9 20:29", 19));
  EXPECT_TRUE(unpack_numbers("0:9 20:29", 20));
  EXPECT_FALSE(unpack_numbers("bits 0 ////", 23));
  EXPECT_TRUE(unpack_numbers("bits 0 ////", 24));
}

}  // namespace
}  // namespace v3d::control
