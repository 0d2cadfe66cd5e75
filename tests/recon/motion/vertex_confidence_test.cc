#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "recon/motion/segment_tracker.h"
#include "recon/motion/template_fit.h"
#include "recon/motion/tracked_body.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

/// The vertex of the template that is nearest to the middle of the bump of with_bump().
size_t vertex_at_bump(const Mesh& surface) {
  const Vector3f bump(-0.3F, 0, 0);
  size_t nearest = 0;
  for (size_t v = 1; v < surface.vertices.size(); ++v) {
    const auto distance = [&](size_t i) { return (surface.vertices[i] - bump).norm(); };
    if (distance(v) < distance(nearest)) nearest = v;
  }
  return nearest;
}

TEST(VertexConfidence, falls_where_the_observed_surface_is_not_where_the_graph_moved_the_template) {
  const PulseSource source = [](size_t i) {
    return pulse_with(static_cast<int>(i), i == 2 ? with_bump(egg(), 0.01F) : egg());
  };
  TrackingOptions options = small_options();
  options.fusion = false;
  options.node_spacing_m = 0.3;  // too wide to follow the bump
  const TrackedSegment segment = track_segment(source, 0, 0, 3, 3, options);
  ASSERT_EQ(segment.pulses.size(), 3U);
  const size_t bump = vertex_at_bump(segment.surface);
  EXPECT_GT(segment.confidences[1][bump], 160) << "meshes alone count as two cameras";
  EXPECT_LT(segment.confidences[2][bump], 130);
  EXPECT_GT(segment.confidences[2][bump], 0);
  for (size_t v = 0; v < segment.surface.vertices.size(); ++v) {
    if (segment.surface.vertices[v].x() < 0.1F) continue;
    EXPECT_GT(segment.confidences[2][v], 150);
  }
}

TEST(VertexConfidence, is_zero_where_no_observed_surface_is_near) {
  // The last mesh has a hole of 16 cm.
  const PulseSource source = [](size_t i) {
    Mesh surface = egg();
    if (i == 2) {
      std::erase_if(surface.triangles, [&](const auto& triangle) {
        return (surface.vertices[triangle[0]] - Vector3f(-0.3F, 0, 0)).norm() < 0.08F;
      });
    }
    return pulse_with(static_cast<int>(i), std::move(surface));
  };
  const TrackedSegment segment = track_segment(source, 0, 0, 3, 3, small_options());
  ASSERT_EQ(segment.pulses.size(), 3U);
  const size_t middle = vertex_at_bump(segment.surface);
  EXPECT_GT(segment.confidences[1][middle], 160);
  EXPECT_EQ(segment.confidences[2][middle], 0);
}

/// Mean confidence around the equator of the ball.
double mean_confidence(const TrackedSegment& segment, size_t pulse) {
  double sum = 0;
  int count = 0;
  for (size_t v = 0; v < segment.surface.vertices.size(); ++v) {
    if (std::abs(segment.surface.vertices[v].z()) > 0.1F) continue;
    sum += segment.confidences[pulse][v];
    ++count;
  }
  EXPECT_GT(count, 50);
  return sum / count;
}

TEST(VertexConfidence, falls_to_a_half_where_learnt_patches_are_not_found_for_ten_pulses) {
  const std::vector<CameraModel> models = four_models();
  const Mesh patterned = patterned_ball(0);
  Mesh plain = patterned;
  plain.colours.assign(plain.vertices.size(), Rgb8{128, 128, 128});
  std::vector<std::shared_ptr<const ObservedPulse>> pulses;
  for (int pulse = 0; pulse < 12; ++pulse) {
    pulses.push_back(pulse_of_ball(pulse, pulse < 2 ? patterned : plain, models));
  }
  const PulseSource source = [&](size_t i) { return pulses[i]; };
  TrackingOptions options;
  options.triangles = 1200;
  options.node_spacing_m = 0.12;
  options.patch_spacing_m = 0.04;
  const TrackedSegment segment = track_segment(source, 0, 0, 12, 12, options);
  ASSERT_EQ(segment.pulses.size(), 12U);
  const double found = mean_confidence(segment, 1);
  EXPECT_GT(found, 60);
  EXPECT_GT(mean_confidence(segment, 2), 0.85 * found) << "one pulse proves little";
  EXPECT_LT(mean_confidence(segment, 11), 0.7 * found);
  options.photometry = false;
  const TrackedSegment by_shape = track_segment(source, 0, 0, 12, 12, options);
  EXPECT_GT(mean_confidence(by_shape, 11), 0.95 * mean_confidence(by_shape, 1));
}

}  // namespace
}  // namespace v3d::recon
