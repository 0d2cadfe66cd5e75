#include "recon/motion/motion_tracker.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "recon/motion/template_surface.h"
#include "recon/motion/tracked_body.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

TEST(Simplified, keeps_a_closed_surface_near_the_given_one) {
  const Mesh mesh = body_at(0);
  const Mesh small = simplified(mesh, 1500);
  EXPECT_NEAR(static_cast<double>(small.triangles.size()), 1500, 20);
  EXPECT_TRUE(is_manifold(small));
  EXPECT_NEAR(enclosed_volume(small), enclosed_volume(mesh), 0.02 * enclosed_volume(mesh));
}

TEST(Simplified, keeps_all_triangles_of_a_small_mesh_and_leaves_out_unused_vertices) {
  Mesh mesh = shapes::sphere({0, 0, 0}, 1, 5);
  const size_t used = mesh.vertices.size();
  mesh.vertices.insert(mesh.vertices.begin(), Eigen::Vector3f(9, 9, 9));
  for (auto& triangle : mesh.triangles) {
    for (uint32_t& vertex : triangle) ++vertex;
  }
  const Mesh same = simplified(mesh, 1000);
  EXPECT_EQ(same.triangles.size(), mesh.triangles.size());
  EXPECT_EQ(same.vertices.size(), used);
  EXPECT_TRUE(is_manifold(same));
}

TEST(TrackSegment, follows_points_of_a_surface_that_bends_and_moves) {
  constexpr int kPulses = 8, kKey = 3;
  const PulseSource source = [](size_t i) {
    return pulse_with(static_cast<int>(i), body_at(static_cast<int>(i)));
  };
  const TrackedSegment segment = track_segment(source, 0, kKey, kPulses, kPulses, small_options());
  ASSERT_EQ(segment.pulses.size(), size_t{kPulses});
  EXPECT_EQ(segment.key, size_t{kKey});
  // A vertex of the template is a vertex of the body at the key pulse.
  const Mesh key = body_at(kKey);
  const Mesh first = body_at(0), last = body_at(kPulses - 1);
  double sum = 0;
  size_t count = 0;
  for (size_t v = 0; v < segment.surface.vertices.size(); v += 7) {
    size_t same = 0;
    for (size_t k = 1; k < key.vertices.size(); ++k) {
      const auto distance = [&](size_t i) {
        return (key.vertices[i] - segment.positions[kKey][v]).norm();
      };
      if (distance(k) < distance(same)) same = k;
    }
    sum += (segment.positions[0][v] - first.vertices[same]).norm();
    sum += (segment.positions[kPulses - 1][v] - last.vertices[same]).norm();
    count += 2;
  }
  const double moved = (first.vertices[0] - last.vertices[0]).norm();
  EXPECT_GT(moved, 0.15);
  EXPECT_LT(sum / static_cast<double>(count), 0.006);
  for (const PulseResidual& residual : segment.residuals) EXPECT_LT(residual.median_m, 0.002);
}

TEST(TrackSegment, ends_where_the_template_does_not_explain_the_surface) {
  const PulseSource source = [](size_t i) {
    Mesh surface = body_at(static_cast<int>(i));
    if (i >= 4) shapes::append(surface, shapes::sphere({1, 0, 0}, 0.2F, 20));
    return pulse_with(static_cast<int>(i), std::move(surface));
  };
  const TrackedSegment segment = track_segment(source, 0, 1, 7, 7, small_options());
  EXPECT_EQ(segment.pulses, (std::vector<int64_t>{0, 1, 2, 3, 4}));
  EXPECT_TRUE(segment.shares_last);
  EXPECT_GT(segment.residuals.back().far, small_options().max_far);
}

TEST(TrackSegment, ends_where_the_template_does_not_explain_the_surface_also_with_one_camera) {
  const CameraModel model = shapes::camera({2, 0, 0}, {0, 0, 0}, {200, 150}, 250);
  const PulseSource source = [&](size_t i) {
    Mesh surface = body_at(static_cast<int>(i));
    auto observed = std::make_shared<ObservedPulse>();
    observed->pulse = static_cast<int64_t>(i);
    observed->frames.frames = {
        observe("cam", {}, draw_mesh(surface, model).view(), draw_silhouette(surface, model))};
    if (i >= 4) shapes::append(surface, shapes::sphere({0, 0.7F, 0}, 0.2F, 20));
    const DeformCamera camera{&model, &observed->frames.frames[0]};
    observed->cameras = SurfaceCameras({&camera, 1}, surface, 0.01);
    observed->surface = std::move(surface);
    return observed;
  };
  const TrackedSegment segment = track_segment(source, 0, 1, 7, 7, small_options());
  EXPECT_EQ(segment.pulses, (std::vector<int64_t>{0, 1, 2, 3, 4}));
  EXPECT_GT(segment.residuals.front().median_m, 0);
}

TEST(TrackSegment, shows_the_first_pulse_of_the_next_segment_when_it_explains_it_or_not) {
  const PulseSource source = [](size_t i) {
    return pulse_with(static_cast<int>(i), i < 5 ? body_at(static_cast<int>(i)) : Mesh());
  };
  const TrackedSegment shared = track_segment(source, 0, 1, 3, 5, small_options());
  EXPECT_EQ(shared.pulses, (std::vector<int64_t>{0, 1, 2, 3}));
  EXPECT_TRUE(shared.shares_last);
  EXPECT_LT(shared.residuals.back().median_m, 0.002);
  const TrackedSegment last = track_segment(source, 0, 1, 5, 7, small_options());
  EXPECT_EQ(last.pulses, (std::vector<int64_t>{0, 1, 2, 3, 4})) << "pulse 5 has no surface";
  EXPECT_FALSE(last.shares_last);
}

TEST(TrackSegment, keeps_its_shape_over_sixty_pulses_of_steady_motion) {
  constexpr int kPulses = 60;
  TrackingOptions options = small_options();
  options.triangles = 500;
  options.node_spacing_m = 0.15;
  const PulseSource source = [](size_t i) {
    const auto t = static_cast<float>(i);
    const Eigen::Isometry3f motion =
        Eigen::Translation3f(0.02F * t, 0, 0) * Eigen::AngleAxisf(0.05F * t, Vector3f::UnitZ());
    Mesh surface = body_at(0);
    for (Vector3f& vertex : surface.vertices) vertex = motion * vertex;
    return pulse_with(static_cast<int>(i), std::move(surface));
  };
  const TrackedSegment segment = track_segment(source, 0, 0, kPulses, kPulses, options);
  ASSERT_EQ(segment.pulses.size(), size_t{kPulses});
  EXPECT_LT(segment.residuals.back().median_m, 0.002);
}

TEST(TrackSegment, follows_a_steady_motion_across_lost_pulses) {
  const std::vector<int64_t> numbers{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 16, 17};
  TrackingOptions options = small_options();
  options.triangles = 500;
  options.node_spacing_m = 0.15;
  const PulseSource source = [&](size_t i) {
    // Accelerates to 0.15 m per pulse. After the gap, the surface is out of reach of a fit that
    // begins one pulse further.
    const auto t = static_cast<float>(numbers[i]);
    const float x = t <= 8 ? 0.01F * t * t : 0.64F + 0.15F * (t - 8);
    Mesh surface = body_at(0);
    for (Vector3f& vertex : surface.vertices) vertex.x() += x;
    return pulse_with(static_cast<int>(numbers[i]), std::move(surface));
  };
  const TrackedSegment segment =
      track_segment(source, 0, 0, numbers.size(), numbers.size(), options);
  EXPECT_EQ(segment.pulses, numbers);
  EXPECT_LT(segment.residuals.back().median_m, 0.002);
}

/// One grey value for all vertices, which cameras see.
Texture grey_texture(const Mesh& surface, uint8_t grey) {
  Texture texture;
  texture.colours.assign(surface.vertices.size(), Rgb8{grey, grey, grey});
  texture.seen.assign(surface.vertices.size(), 1);
  return texture;
}

TEST(TrackSegment, asks_for_the_colours_of_a_pulse_while_it_is_the_last_one_that_was_read) {
  std::vector<size_t> reads;
  const PulseSource source = [&](size_t i) {
    reads.push_back(i);
    return pulse_with(static_cast<int>(i), body_at(static_cast<int>(i)));
  };
  const SurfaceColours colours = [&](size_t i, const Mesh& surface) {
    EXPECT_EQ(reads.back(), i);
    return grey_texture(surface, static_cast<uint8_t>(100 + 50 * i));
  };
  const TrackedSegment segment = track_segment(source, 0, 1, 3, 3, small_options(), colours);
  ASSERT_EQ(segment.colours.size(), 3U);
  for (size_t i = 0; i < 3; ++i) {
    ASSERT_EQ(segment.colours[i].size(), segment.surface.vertices.size());
    EXPECT_EQ(segment.colours[i][0].r, 100 + 50 * i);
  }
}

TEST(TrackSegment, steadies_colours_over_the_pulses_with_images) {
  const PulseSource source = [](size_t i) {
    return pulse_with(static_cast<int>(i), body_at(static_cast<int>(i)));
  };
  const SurfaceColours colours = [](size_t i, const Mesh& surface) {
    return i == 1 ? Texture() : grey_texture(surface, static_cast<uint8_t>(i == 0 ? 100 : 107));
  };
  const TrackedSegment segment = track_segment(source, 0, 0, 3, 3, small_options(), colours);
  ASSERT_EQ(segment.colours.size(), 3U);
  EXPECT_EQ(segment.colours[0].at(0).r, 100);
  EXPECT_TRUE(segment.colours[1].empty());
  EXPECT_EQ(segment.colours[2].at(0).r, 101);
}

TEST(TrackSegment, gives_the_same_bits_with_any_number_of_threads) {
  const PulseSource source = [](size_t i) {
    return pulse_with(static_cast<int>(i), body_at(static_cast<int>(i)));
  };
  const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, 4);
  std::vector<TrackedSegment> segments;
  for (const int threads : {1, 3}) {
    tbb::task_arena arena(threads);
    arena.execute([&] { segments.push_back(track_segment(source, 0, 1, 3, 3, small_options())); });
  }
  EXPECT_EQ(segments[0].positions, segments[1].positions);
  EXPECT_EQ(segments[0].confidences, segments[1].confidences);
}

TEST(TrackMotion, reports_pulses_without_a_surface_and_tracks_the_others) {
  // The studio is empty in the first two pulses and in the sixth.
  const PulseSource source = [](size_t i) {
    const int pulse = static_cast<int>(i);
    const bool is_empty = i < 2 || i == 5;
    return pulse_with(10 + pulse, is_empty ? Mesh() : body_at(pulse));
  };
  int calls = 0;
  const TrackedMotion motion =
      track_motion({source, source}, 8, small_options(), [&](size_t) { ++calls; });
  ASSERT_EQ(motion.segments.size(), 2U);
  EXPECT_EQ(motion.segments[0].pulses, (std::vector<int64_t>{12, 13, 14}));
  EXPECT_EQ(motion.segments[1].pulses, (std::vector<int64_t>{16, 17}));
  ASSERT_EQ(motion.untracked.size(), 2U);
  EXPECT_EQ(motion.untracked[0].first, 0U);
  EXPECT_EQ(motion.untracked[0].last, 1U);
  EXPECT_EQ(motion.untracked[1].first, 5U);
  EXPECT_EQ(motion.untracked[0].reason, "no surface");
  EXPECT_GE(calls, 8 + 2 * 5);
}

TEST(TrackMotion, begins_another_segment_after_ten_lost_pulses_but_not_after_nine) {
  const std::vector<int64_t> numbers{0, 1, 11, 12, 23};
  const PulseSource source = [&](size_t i) {
    return pulse_with(static_cast<int>(numbers[i]), body_at(0));
  };
  const TrackedMotion motion =
      track_motion({source, source}, numbers.size(), small_options(), [](size_t) {});
  ASSERT_EQ(motion.segments.size(), 2U);
  EXPECT_EQ(motion.segments[0].pulses, (std::vector<int64_t>{0, 1, 11, 12}));
  EXPECT_FALSE(motion.segments[0].shares_last);
  EXPECT_EQ(motion.segments[1].pulses, (std::vector<int64_t>{23}));
  EXPECT_TRUE(motion.untracked.empty());
}

TEST(TrackMotion, begins_with_a_pulse_that_cameras_see_and_not_with_one_without_images) {
  const std::array<CameraModel, 2> models = two_models();
  const PulseSource source = [&](size_t i) {
    const int pulse = static_cast<int>(i);
    return i == 1 ? pulse_with(pulse, body_at(0)) : pulse_with_images(pulse, body_at(0), models);
  };
  const TrackedMotion motion = track_motion({source, source}, 3, small_options(), [](size_t) {});
  ASSERT_FALSE(motion.segments.empty());
  const TrackedSegment& first = motion.segments[0];
  EXPECT_EQ(first.pulses[first.key], 0);
}

TEST(TrackMotion, reads_images_first_of_the_pulse_whose_surface_promises_most) {
  const std::array<CameraModel, 2> models = two_models();
  std::vector<size_t> reads;
  const PulseSource surfaces = [&](size_t i) {
    Mesh body = body_at(0);
    for (Vector3f& vertex : body.vertices) vertex *= i == 1 ? 1.05F : 1.0F;
    return pulse_with_images(static_cast<int>(i), body, models);
  };
  const PulseSource pulses = [&](size_t i) {
    reads.push_back(i);
    return surfaces(i);
  };
  TrackingOptions options = small_options();
  options.photometry = false;
  const TrackedMotion motion = track_motion({pulses, surfaces}, 3, options, [](size_t) {});
  ASSERT_FALSE(reads.empty());
  EXPECT_EQ(reads.front(), 1U);
  EXPECT_TRUE(std::ranges::any_of(motion.segments,
                                  [](const TrackedSegment& s) { return s.pulses[s.key] == 1; }));
}

TEST(TrackMotion, chooses_the_key_pulse_by_what_its_images_show_and_not_by_its_surface_alone) {
  const std::array<CameraModel, 2> models = two_models();
  const PulseSource surfaces = [&](size_t i) {
    return pulse_with_images(static_cast<int>(i), body_at(0), models);
  };
  // The silhouettes of the first pulse are a small ball, as after a wrong segmentation.
  const Mesh ball = shapes::sphere({0, 0, 0.3F}, 0.03F, 8);
  const PulseSource pulses = [&](size_t i) {
    return i == 0 ? pulse_with_images(0, body_at(0), models, ball) : surfaces(i);
  };
  TrackingOptions options = small_options();
  options.photometry = false;
  const TrackedMotion motion = track_motion({pulses, surfaces}, 3, options, [](size_t) {});
  ASSERT_EQ(motion.segments.size(), 1U);
  const TrackedSegment& segment = motion.segments[0];
  EXPECT_EQ(segment.pulses[segment.key], 1);
}

TEST(TrackMotion, begins_another_segment_where_one_ends) {
  const PulseSource source = [](size_t i) {
    Mesh surface = body_at(static_cast<int>(i));
    if (i >= 3) shapes::append(surface, shapes::sphere({1, 0, 0}, 0.2F, 20));
    return pulse_with(static_cast<int>(i), std::move(surface));
  };
  const TrackedMotion motion = track_motion({source, source}, 6, small_options(), [](size_t) {});
  ASSERT_EQ(motion.segments.size(), 2U);
  EXPECT_EQ(motion.segments[0].pulses, (std::vector<int64_t>{0, 1, 2, 3})) << "shares pulse 3";
  EXPECT_TRUE(motion.segments[0].shares_last);
  EXPECT_EQ(motion.segments[1].pulses, (std::vector<int64_t>{3, 4, 5}));
  EXPECT_FALSE(motion.segments[1].shares_last);
}

TEST(KeyQuality, prefers_a_surface_without_handles_and_fragments) {
  const auto score = [](Mesh mesh) {
    return key_quality(*pulse_with(0, std::move(mesh))).score(1);
  };
  const Mesh ball = shapes::sphere({0, 0, 0}, 0.3F, 20);
  Mesh with_fragment = ball;
  shapes::append(with_fragment, shapes::sphere({1, 0, 0}, 0.005F, 6));
  EXPECT_GT(score(ball), score(with_fragment));
  EXPECT_GT(score(shapes::sphere({0, 0, 0}, 0.31F, 20)), score(ball));
  EXPECT_FALSE(score(Mesh()));
}

}  // namespace
}  // namespace v3d::recon
