#include <gtest/gtest.h>

#include "base/core/error.h"

namespace v3d {
namespace {

TEST(Check, evaluates_a_true_condition_once_and_continues) {
  int evaluated = 0;
  V3D_CHECK(++evaluated == 1);
  EXPECT_EQ(evaluated, 1);
}

TEST(CheckDeathTest, aborts_with_place_and_condition_in_every_build) {
  const int cameras = 3;
  EXPECT_DEATH(V3D_CHECK(cameras == 4 && "one for each mask"),
               "check_test\\.cc:[0-9]+: check failed: cameras == 4 && \"one for each mask\"\n$");
}

}  // namespace
}  // namespace v3d
