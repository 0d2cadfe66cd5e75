#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "recon/motion/deformation_graph.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;

/// A node that turns by 0.1 rad about an axis and moves by 50 mm, each pulse.
std::vector<NodeMotion> node_at(double pulse) {
  const Eigen::AngleAxisd turn(0.4 + 0.1 * pulse, Vector3d(1, 2, -1).normalized());
  return {NodeMotion{turn.toRotationMatrix(), Vector3d(1, 0.05 * pulse, 2)}};
}

/// Is `motion` that of the node at `pulse`?
void expect_node_at(double pulse, const std::vector<NodeMotion>& motion) {
  const NodeMotion truth = node_at(pulse)[0];
  EXPECT_LT((motion.at(0).rotation - truth.rotation).norm(), 1e-9) << pulse;
  EXPECT_LT((motion.at(0).position - truth.position).norm(), 1e-9) << pulse;
}

TEST(WithSameSpeed, continues_the_motion_of_the_last_pulse) {
  expect_node_at(2, with_same_speed(node_at(0), node_at(1), 1));
  expect_node_at(-1, with_same_speed(node_at(1), node_at(0), 1));
}

TEST(WithSameSpeed, moves_and_turns_farther_across_lost_pulses) {
  expect_node_at(5, with_same_speed(node_at(0), node_at(1), 4));
}

TEST(WithSameSpeed, moves_and_turns_less_far_after_lost_pulses) {
  expect_node_at(5, with_same_speed(node_at(0), node_at(4), 0.25));
}

TEST(WithSameSpeed, keeps_a_node_that_stands_still) {
  expect_node_at(3, with_same_speed(node_at(3), node_at(3), 7));
}

}  // namespace
}  // namespace v3d::recon
