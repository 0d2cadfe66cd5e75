#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <set>

#include "take/ledger/ledger.h"

namespace v3d::take {
namespace {

using Numbers = std::vector<int64_t>;

RC_GTEST_PROP(PulseSet, matches_a_plain_set, ()) {
  const auto numbers = *rc::gen::container<Numbers>(rc::gen::inRange<int64_t>(-3, 30));
  const auto commanded = *rc::gen::inRange<int64_t>(0, 25);
  PulseSet pulses;
  std::set<int64_t> plain;
  for (const int64_t n : numbers) RC_ASSERT(pulses.insert(n) == plain.insert(n).second);
  RC_ASSERT(pulses.size() == std::ssize(plain));
  RC_ASSERT(pulses.last() == (plain.empty() ? -1 : *plain.rbegin()));
  RC_ASSERT(pulses.all() == Numbers(plain.begin(), plain.end()));
  Numbers missing, outside;
  for (int64_t n = -3; n < 30; ++n) {
    RC_ASSERT(pulses.contains(n) == plain.contains(n));
    const bool inside = n >= 0 && n < commanded;
    if (inside && !plain.contains(n)) missing.push_back(n);
    if (!inside && plain.contains(n)) outside.push_back(n);
  }
  RC_ASSERT(pulses.missing(commanded) == missing);
  RC_ASSERT(pulses.outside(commanded) == outside);
}

TEST(PulseSet, accepts_any_number) {
  PulseSet pulses;
  for (const int64_t n : {INT64_MAX, INT64_MIN, INT64_MAX - 1, INT64_MIN + 1, int64_t{0}}) {
    EXPECT_TRUE(pulses.insert(n));
    EXPECT_FALSE(pulses.insert(n));
  }
  EXPECT_EQ(pulses.all(), (Numbers{INT64_MIN, INT64_MIN + 1, 0, INT64_MAX - 1, INT64_MAX}));
  EXPECT_EQ(pulses.missing(2), (Numbers{1}));
}

}  // namespace
}  // namespace v3d::take
