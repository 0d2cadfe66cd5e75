// Each part of the tracker that TrackingOptions can switch off: heterogeneity, fusion, photometry.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "recon/motion/deformation_graph.h"
#include "recon/motion/segment_tracker.h"
#include "recon/motion/template_fit.h"
#include "recon/motion/template_surface.h"
#include "recon/motion/tracked_body.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

/// The upper half turns around the x axis, the lower half rests. The joint is 10 cm long.
Mesh hinged_body(int pulse) {
  Mesh mesh = body_at(0);
  for (Vector3f& p : mesh.vertices) {
    const float share = std::clamp(10 * p.z() + 0.5F, 0.0F, 1.0F);
    const float angle = 0.04F * static_cast<float>(pulse) * share;
    const Vector3f turned = Eigen::AngleAxisf(angle, Vector3f::UnitX()) * p;
    p = turned;
  }
  return mesh;
}

/// Means of the stiffness of edges far from the joint of hinged_body(), and in it.
struct MeanStiffness {
  double of_halves = 0, of_joint = 0;
};

MeanStiffness mean_stiffness(const DeformationGraph& graph) {
  MeanStiffness sum;
  int in_halves = 0, in_joint = 0;
  for (const DeformationGraph::Edge& edge : graph.edges()) {
    const double a = graph.rest()[edge.a].z(), b = graph.rest()[edge.b].z();
    if (std::min(a, b) > 0.15 || std::max(a, b) < -0.15) {
      sum.of_halves += double{edge.stiffness};
      ++in_halves;
    } else if (std::max(std::abs(a), std::abs(b)) < 0.08) {
      sum.of_joint += double{edge.stiffness};
      ++in_joint;
    }
  }
  EXPECT_GT(in_halves, 20);
  EXPECT_GT(in_joint, 5);
  return {sum.of_halves / in_halves, sum.of_joint / in_joint};
}

TEST(Heterogeneity, is_learnt_from_fits_as_stiff_halves_with_a_soft_joint) {
  constexpr std::array kStages{
      FitStage{8, 0.15, 0.2, 20, 2, -1, true},
      FitStage{2, 0.04, 0.5, 4, 0.4, -1, true},
      FitStage{2, 0.02, 0.6, 2, 0.2, -1, false},
      FitStage{1, 0.015, 0.6, 0.5, 0.05, -1, false},
  };
  TemplateFit fit(simplified(hinged_body(0), small_options().triangles), small_options());
  std::vector<std::vector<NodeMotion>> motions{fit.graph().rest_motion()};
  for (int pulse = 1; pulse < 8; ++pulse) {
    std::vector<NodeMotion> motion = motions.back();
    fit.fit(ObservedSurface(pulse_with(pulse, hinged_body(pulse))), kStages, motion);
    motions.push_back(motion);
  }
  learn_stiffness(fit.graph(), motions);
  const MeanStiffness mean = mean_stiffness(fit.graph());
  EXPECT_GT(mean.of_halves, 1);
  EXPECT_GT(mean.of_halves, 2 * mean.of_joint);
}

TEST(Heterogeneity, changes_the_second_pass_and_keeps_the_surface_on_the_observed_one) {
  const PulseSource source = [](size_t i) {
    return pulse_with(static_cast<int>(i), hinged_body(static_cast<int>(i)));
  };
  TrackingOptions options = small_options();
  const TrackedSegment learnt = track_segment(source, 0, 0, 6, 6, options);
  options.heterogeneity = false;
  const TrackedSegment uniform = track_segment(source, 0, 0, 6, 6, options);
  ASSERT_EQ(learnt.pulses.size(), 6U);
  ASSERT_EQ(uniform.pulses.size(), 6U);
  EXPECT_NE(learnt.positions, uniform.positions);
  EXPECT_LT(learnt.residuals.back().median_m, 0.003);
}

/// Mean distance of the vertices around the bump from the body without it, metres.
double error_at_bump(const Mesh& surface) {
  const ObservedSurface truth(pulse_with(0, egg()));
  double sum = 0;
  int count = 0;
  for (const Vector3f& p : surface.vertices) {
    if (p.x() > 0 || p.tail<2>().norm() > 0.04F) continue;
    sum += truth.distance(p.cast<double>());
    ++count;
  }
  EXPECT_GT(count, 2);
  return sum / count;
}

TEST(Fusion, corrects_the_template_where_other_pulses_show_what_the_key_pulse_hides) {
  // The mesh of the key pulse has a bump where its cameras do not see it. Later cameras do.
  const std::array<CameraModel, 2> front = two_models(), back = two_models(-1);
  std::vector<std::shared_ptr<const ObservedPulse>> pulses{
      pulse_with_images(0, with_bump(egg(), 0.015F), front)};
  for (int pulse = 1; pulse < 6; ++pulse) {
    pulses.push_back(pulse_with_images(pulse, egg(), back));
  }
  const PulseSource source = [&](size_t i) { return pulses[i]; };
  TrackingOptions options = small_options();
  options.photometry = false;
  options.node_spacing_m = 0.3;  // too wide to follow the bump
  const TrackedSegment fused = track_segment(source, 0, 0, 6, 6, options);
  options.fusion = false;
  const TrackedSegment plain = track_segment(source, 0, 0, 6, 6, options);
  ASSERT_EQ(fused.pulses.size(), 6U);
  ASSERT_EQ(plain.pulses.size(), 6U);
  EXPECT_GT(error_at_bump(plain.surface), 0.006);
  EXPECT_LT(error_at_bump(fused.surface), 0.5 * error_at_bump(plain.surface));
}

constexpr float kTurn = 0.04F;  ///< of the ball from one pulse to the next, radians

/// Median error of the vertices around the equator after the last pulse, as a part of the way that
/// they should have moved.
float missed_part(const TrackedSegment& segment) {
  const Eigen::AngleAxisf turn(kTurn * static_cast<float>(segment.pulses.back()),
                               Vector3f::UnitZ());
  std::vector<float> parts;
  for (size_t v = 0; v < segment.surface.vertices.size(); ++v) {
    const Vector3f first = segment.positions.front()[v];
    if (std::abs(first.z()) > 0.15F) continue;
    const Vector3f wanted = turn * first;
    parts.push_back((segment.positions.back()[v] - wanted).norm() / (wanted - first).norm());
  }
  std::ranges::nth_element(parts, parts.begin() + std::ssize(parts) / 2);
  return parts[parts.size() / 2];
}

TEST(Photometry, follows_a_pattern_that_turns_on_a_surface_whose_shape_does_not_show_it) {
  const std::vector<CameraModel> models = four_models();
  std::vector<std::shared_ptr<const ObservedPulse>> pulses;
  for (int pulse = 0; pulse < 5; ++pulse) {
    pulses.push_back(
        pulse_of_ball(pulse, patterned_ball(kTurn * static_cast<float>(pulse)), models));
  }
  const PulseSource source = [&](size_t i) { return pulses[i]; };
  TrackingOptions options = small_options();
  options.patch_spacing_m = 0.04;
  const TrackedSegment matched = track_segment(source, 0, 0, 5, 5, options);
  options.photometry = false;
  const TrackedSegment by_shape = track_segment(source, 0, 0, 5, 5, options);
  ASSERT_EQ(matched.pulses.size(), 5U);
  ASSERT_EQ(by_shape.pulses.size(), 5U);
  EXPECT_LT(missed_part(matched), 0.25F);
  EXPECT_GT(missed_part(by_shape), 0.9F);
}

}  // namespace
}  // namespace v3d::recon
