#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "base/geometry/mesh.h"
#include "recon/random_rig.h"

namespace v3d::recon {
namespace {

VertexLattice random_lattice() {
  return {Eigen::Vector3d(uniform(-3, 3), uniform(-3, 3), uniform(-3, 3)), uniform(1e-4, 0.02)};
}

RC_GTEST_PROP(VertexLattice, gives_the_nearest_point_of_the_lattice, ()) {
  const VertexLattice lattice = random_lattice();
  const Eigen::Vector3f at(
      Eigen::Vector3d(uniform(-4, 4), uniform(-4, 4), uniform(-4, 4)).cast<float>());
  const Eigen::Vector3f rounded = rounded_to(lattice, at);
  for (int axis = 0; axis < 3; ++axis) {
    // The result is a float: at 4 m its last digit is worth 0.5 um.
    RC_ASSERT(std::abs(double{rounded[axis]} - at[axis]) <= lattice.step / 2 + 1e-6);
    const double h = (double{rounded[axis]} - lattice.origin[axis]) / lattice.step;
    RC_ASSERT(std::abs(h - std::round(h)) * lattice.step < 1e-6);
  }
}

RC_GTEST_PROP(VertexLattice, keeps_the_bits_of_a_point_that_is_on_the_lattice, ()) {
  const VertexLattice lattice = random_lattice();
  Eigen::Vector3f on_lattice;
  for (int axis = 0; axis < 3; ++axis) {
    on_lattice[axis] =
        static_cast<float>(lattice.origin[axis] + uniform_int(-100, 101) * lattice.step);
  }
  RC_ASSERT(rounded_to(lattice, on_lattice) == on_lattice);
}

TEST(VertexLattice, rounds_a_half_up_on_both_sides_of_the_origin) {
  const VertexLattice lattice{Eigen::Vector3d::Zero(), 0.25};
  EXPECT_EQ(rounded_to(lattice, {0.125F, -0.125F, -0.375F}), Eigen::Vector3f(0.25F, 0, -0.25F));
}

}  // namespace
}  // namespace v3d::recon
