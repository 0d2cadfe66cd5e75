#include "recon/motion/segment_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "recon/motion/motion_tracker.h"
#include "recon/motion/tracked_body.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;
using testing::ElementsAre;
using testing::IsEmpty;

/// With a surface where the character is '#'.
TakeSurvey survey_of(const std::string& surfaces, std::vector<int64_t> pulses = {}) {
  TakeSurvey survey;
  for (const char c : surfaces) {
    if (pulses.size() < surfaces.size()) pulses.push_back(std::ssize(pulses));
    KeyQuality quality;
    quality.components = c == '#' ? 1 : 0;
    quality.area_m2 = 1;
    survey.qualities.push_back(quality);
  }
  survey.pulses = std::move(pulses);
  return survey;
}

TEST(TakeIntervals, end_at_pulses_without_a_surface_and_at_ten_lost_pulses) {
  const TakeIntervals empty_studio = intervals_of(survey_of("..###.##"));
  EXPECT_THAT(empty_studio.tracked, ElementsAre(SegmentRange{2, 5, 5}, SegmentRange{6, 8, 8}));
  ASSERT_EQ(empty_studio.untracked.size(), 2U);
  EXPECT_EQ(empty_studio.untracked[0].last, 1U);
  EXPECT_EQ(empty_studio.untracked[1].first, 5U);
  EXPECT_THAT(intervals_of(survey_of("####", {0, 10, 21, 22})).tracked,
              ElementsAre(SegmentRange{0, 2, 2}, SegmentRange{2, 4, 4}));
  EXPECT_THAT(intervals_of(survey_of("")).tracked, IsEmpty());
}

TEST(SegmentPlan, opens_what_a_segment_leaves_uncovered_on_both_sides) {
  const SegmentRange range{10, 20, 30};
  EXPECT_THAT(rest_of(range, {13, 17}),
              ElementsAre(SegmentRange{10, 13, 30}, SegmentRange{17, 20, 30}));
  EXPECT_THAT(rest_of(range, {10, 17}), ElementsAre(SegmentRange{17, 20, 30}));
  EXPECT_THAT(rest_of(range, {10, 20}), IsEmpty());
}

TEST(SegmentPlan, knows_a_range_only_when_the_segment_around_it_is_tracked) {
  const std::vector<SegmentRange> intervals{{0, 20, 20}, {21, 25, 25}};
  EXPECT_EQ(plan_of(intervals, {}).open, intervals);
  TrackedExtents tracked{{{0, 20, 20}, {8, 12}}, {{12, 20, 20}, {12, 20}}, {{0, 4, 20}, {0, 4}}};
  SegmentPlan plan = plan_of(intervals, tracked);
  EXPECT_THAT(plan.tracked, ElementsAre(SegmentRange{0, 20, 20}, SegmentRange{12, 20, 20}));
  EXPECT_THAT(plan.open, ElementsAre(SegmentRange{0, 8, 20}, SegmentRange{21, 25, 25}));
  tracked[{0, 8, 20}] = {4, 8};
  plan = plan_of(intervals, tracked);
  EXPECT_THAT(plan.tracked, ElementsAre(SegmentRange{0, 4, 20}, SegmentRange{0, 8, 20},
                                        SegmentRange{0, 20, 20}, SegmentRange{12, 20, 20}))
      << "ascending by their segments";
  EXPECT_THAT(plan.open, ElementsAre(SegmentRange{21, 25, 25}));
}

/// A body with a large ball beside it at pulses 3 to 5, and a small one from pulse 6 on.
std::shared_ptr<const ObservedPulse> pulse_with_balls(size_t i) {
  Mesh surface = body_at(static_cast<int>(i));
  if (i >= 3 && i < 6) shapes::append(surface, shapes::sphere({1, 0, 0}, 0.25F, 20));
  if (i >= 6) shapes::append(surface, shapes::sphere({-1, 0, 0}, 0.2F, 20));
  return pulse_with(static_cast<int>(i), std::move(surface));
}

TEST(SegmentPlan, gives_each_range_the_segment_of_the_whole_take_when_it_is_tracked_alone) {
  const TakeSource take{pulse_with_balls, pulse_with_balls};
  const OnPulse on_pulse = [](size_t) {};
  const TrackingOptions options = small_options();
  const TrackedMotion whole = track_motion(take, 9, options, on_pulse);
  ASSERT_EQ(whole.segments.size(), 3U);
  const TakeSurvey survey = survey_pulses(take.surfaces, 9, on_pulse);
  const std::vector<SegmentRange> intervals = intervals_of(survey).tracked;
  TrackedExtents tracked;
  std::vector<TrackedSegment> segments;
  for (SegmentPlan plan = plan_of(intervals, tracked); !plan.open.empty();
       plan = plan_of(intervals, tracked)) {
    const SegmentRange range = plan.open.front();  // track_motion() begins with the last one
    TrackedRange result = RangeTracker(take, survey, options, on_pulse).track(range);
    tracked[range] = result.extent;
    segments.push_back(std::move(result.segment));
  }
  std::ranges::sort(segments, {}, [](const TrackedSegment& s) { return s.pulses[0]; });
  ASSERT_EQ(segments.size(), 3U);
  for (size_t s = 0; s < segments.size(); ++s) {
    EXPECT_EQ(segments[s].pulses, whole.segments[s].pulses);
    EXPECT_EQ(segments[s].key, whole.segments[s].key);
    EXPECT_EQ(segments[s].positions, whole.segments[s].positions);
  }
}

TEST(KeyChooser, chooses_a_key_pulse_that_does_not_depend_on_earlier_choices) {
  const std::array<CameraModel, 2> models = two_models();
  const PulseSource surfaces = [&](size_t i) {
    Mesh body = body_at(0);
    for (Vector3f& vertex : body.vertices) vertex *= 1 + 0.02F * static_cast<float>(i % 3);
    return pulse_with_images(static_cast<int>(i), body, models);
  };
  // The images of pulse 2, the best one of the first three, are lost.
  int reads = 0;
  const PulseSource pulses = [&](size_t i) {
    ++reads;
    return i == 2 ? pulse_with(2, surfaces(2)->surface) : surfaces(i);
  };
  const OnPulse on_pulse = [](size_t) {};
  const TakeSurvey survey = survey_pulses(surfaces, 6, on_pulse);
  KeyChooser chooser(survey, pulses, on_pulse);
  const size_t first = chooser.best_key({0, 3, 6}), second = chooser.best_key({3, 6, 6});
  EXPECT_EQ(reads, 6) << "each pulse is read once";
  EXPECT_EQ(KeyChooser(survey, pulses, on_pulse).best_key({3, 6, 6}), second);
  EXPECT_EQ(chooser.best_key({0, 3, 6}), first);
}

}  // namespace
}  // namespace v3d::recon
