#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/geometry/rigid_transform.h"

namespace v3d {
namespace {

TEST(Bounds, are_two_corners_in_ascending_order) {
  const Box box = parse_bounds("-0.6,-0.6,-0.1,0.6,0.6,1.9");
  EXPECT_EQ(box.min, Eigen::Vector3d(-0.6, -0.6, -0.1));
  EXPECT_EQ(box.max, Eigen::Vector3d(0.6, 0.6, 1.9));
  for (const char* text :
       {"", "1,2,3", "0,0,0,1,1,0", "0,0,0,1,1,1,", "0,0,0,1,1,x", "0 0 0 1 1 1"}) {
    EXPECT_THROW(parse_bounds(text), InputError) << text;
  }
}

}  // namespace
}  // namespace v3d
