// Heads of a body that is seen in some pulses.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "recon/skeleton/body_evidence.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;

/// Pulses with the evidence that follow_head() refers to.
class HeadSeries : public testing::Test {
 protected:
  void see(int64_t number, const std::optional<Vector3d>& head) {
    BodyEvidence evidence;
    evidence.head = head;
    if (head) evidence.neck = *head - Vector3d(0, 0, 0.2);
    evidence_.push_back(std::move(evidence));
    seen_.push_back({seen_.size(), number, &evidence_.back()});
  }
  std::vector<HeadPosition> heads() const { return follow_head(seen_); }

 private:
  std::deque<BodyEvidence> evidence_;  // keeps its elements in place
  std::vector<SeenPulse> seen_;
};

TEST_F(HeadSeries, interpolates_head_and_neck_of_a_pulse_without_a_head) {
  see(10, Vector3d(0, 0, 1.6));
  see(12, {});
  see(14, Vector3d(0.04, 0, 1.6));
  const auto found = heads();
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].weight, 1);
  EXPECT_EQ(found[2].weight, 1);
  EXPECT_GT(found[1].weight, 0);
  EXPECT_LT(found[1].weight, 1);
  EXPECT_LT((found[1].head - Vector3d(0.02, 0, 1.6)).norm(), 1e-9);
  EXPECT_LT((found[1].neck - Vector3d(0.02, 0, 1.4)).norm(), 1e-9);
}

TEST_F(HeadSeries, rejects_a_raised_arm_for_a_pulse) {
  see(0, Vector3d(0, 0, 1.6));
  see(1, Vector3d(0.5, 0, 2.1));
  see(2, Vector3d(0, 0, 1.6));
  const auto found = heads();
  ASSERT_EQ(found.size(), 3U);
  EXPECT_LT((found[1].head - Vector3d(0, 0, 1.6)).norm(), 1e-9);
  EXPECT_LT(found[1].weight, 1);
}

TEST_F(HeadSeries, leaves_a_head_unknown_before_the_first_and_without_any) {
  see(0, {});
  EXPECT_EQ(heads().at(0).weight, 0);
  see(1, Vector3d(0, 0, 1.6));
  const auto found = heads();
  EXPECT_EQ(found.at(0).weight, 0);
  EXPECT_EQ(found.at(1).weight, 1);
}

TEST_F(HeadSeries, is_the_longer_one_of_two_that_are_far_apart_in_time) {
  see(0, Vector3d(1, 0, 1.6));
  see(1000, Vector3d(0, 0, 1.6));
  see(1001, Vector3d(0, 0, 1.6));
  const auto found = heads();
  EXPECT_EQ(found.at(0).weight, 0);
  EXPECT_EQ(found.at(1).weight, 1);
  EXPECT_EQ(found.at(2).weight, 1);
}

}  // namespace
}  // namespace v3d::recon
