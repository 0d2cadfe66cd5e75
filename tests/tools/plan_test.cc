#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "plan/coverage.h"
#include "plan/placement.h"
#include "plan/plan_command.h"
#include "plan/plan_plot.h"
#include "sim/rendering/scene.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "tools/command_outcome.h"

namespace v3d::plan {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;
using testing::HasSubstr;

const Box kSpace{{-1.5, -1.5, 0}, {1.5, 1.5, 2}};

ActionSamples small_action(uint64_t seed, Cast cast = Cast::kSwordsman) {
  ActionOptions options;
  options.cast = cast;
  options.moments = 6;
  options.points = 80;
  options.seed = seed;
  return sample_action(kSpace, options);
}

PlacementOptions six_cameras() {
  PlacementOptions options;
  options.cameras = 6;
  options.lens.focal_mm = {6};
  options.mounts.mounts = {Mount::kRail};
  options.mounts.step_m = 1.2;
  return options;
}

CameraPlacement plan(const ActionSamples& action, const std::vector<CameraModel>& fixed = {}) {
  return place_cameras(kSpace, action, fixed, six_cameras(), [] {});
}

/// A square of 20 x 20 cells with its front towards +x.
sim::DrawList wall_at(float x, float half) {
  constexpr uint32_t kCells = 20;
  sim::DrawList list;
  for (uint32_t j = 0; j <= kCells; ++j) {
    for (uint32_t i = 0; i <= kCells; ++i) {
      list.vertices.emplace_back(x, half * (0.1F * static_cast<float>(i) - 1),
                                 1 + half * (0.1F * static_cast<float>(j) - 1));
    }
  }
  for (uint32_t j = 0; j < kCells; ++j) {
    for (uint32_t i = 0; i < kCells; ++i) {
      const uint32_t a = j * (kCells + 1) + i;
      list.triangles.push_back({a, a + 1, a + kCells + 2});
      list.triangles.push_back({a, a + kCells + 2, a + kCells + 1});
    }
  }
  return list;
}

void append_to(sim::DrawList& list, const sim::DrawList& more) {
  const auto first = static_cast<uint32_t>(list.vertices.size());
  list.vertices.insert(list.vertices.end(), more.vertices.begin(), more.vertices.end());
  for (const auto& [a, b, c] : more.triangles) {
    list.triangles.push_back({a + first, b + first, c + first});
  }
}

/// Two performers who are walls: a large one at x = 0, and a small one in front of its middle.
ActionSamples two_walls() {
  ActionSamples action;
  ActionMoment& moment = action.moments.emplace_back();
  moment.performer = {wall_at(0, 1), wall_at(0.5F, 0.2F)};
  for (const sim::DrawList& wall : moment.performer) append_to(moment.all, wall);
  moment.extent = {{0, -1, 0}, {0.5, 1, 2}};
  const Vector3f front(1, 0, 0);
  action.samples = {{{0, 0.03F, 1.02F}, front, 0, 0},
                    {{0, 0.8F, 1}, front, 0, 0},
                    {{0.5F, 0.03F, 1.02F}, front, 0, 1}};
  return action;
}

TEST(PlanVisibility, ends_at_another_performer_and_at_the_back_of_a_surface) {
  const ActionSamples action = two_walls();
  const auto front = incidence_from({4, 0, 1}, action);
  EXPECT_EQ(front[0], 0) << "behind the small wall";
  EXPECT_NEAR(front[1], 4 / std::hypot(4, 0.8), 0.01);
  EXPECT_GT(front[2], 0.99);
  const auto alone = incidence_from({4, 0, 1}, action, true);
  EXPECT_GT(alone[0], 0.99) << "its own performer does not hide it";
  for (const float cosine : incidence_from({-4, 0, 1}, action)) EXPECT_EQ(cosine, 0);
}

TEST(PlanVisibility, ends_at_the_largest_angle_of_incidence) {
  const ActionSamples action = two_walls();
  const auto from = [&](double degrees) {
    const double angle = degrees * M_PI / 180;
    return incidence_from({3 * std::cos(angle), 0.8 + 3 * std::sin(angle), 1}, action)[1];
  };
  EXPECT_GT(from(kMaxIncidenceDeg - 2), 0);
  EXPECT_EQ(from(kMaxIncidenceDeg + 2), 0);
}

TEST(PlanCoverage, counts_what_another_performer_hides) {
  CandidateLenses lens;
  lens.focal_mm = {4};
  std::vector<CameraModel> rig;
  for (const double y : {-0.05, 0.05}) rig.push_back(ideal_camera(lens, 4, {4, y, 1}, {0, 0, 1}));
  ActionSamples action = two_walls();
  const SurfaceCoverage coverage = measure_coverage(rig, action);
  EXPECT_NEAR(coverage.share[0], 1.0 / 3, 1e-9);
  EXPECT_NEAR(coverage.two_or_more(), 2.0 / 3, 1e-9);
  EXPECT_NEAR(coverage.views_lost, 2.0 / 6, 1e-9);
  EXPECT_NEAR(coverage.below_two, 1.0 / 3, 1e-9);
  EXPECT_NEAR(coverage.widest_baseline_deg.p50, 2 * std::atan(0.05 / 3.5) * 180 / M_PI, 0.3);
}

TEST(PlanCoverage, has_no_accuracy_where_no_point_is_seen_by_two_cameras) {
  CandidateLenses lens;
  const ActionSamples action = two_walls();
  const auto from = [&](const Vector3d& at, const Vector3d& target) {
    return measure_coverage({ideal_camera(lens, 4, at, target)}, action);
  };
  const SurfaceCoverage one = from({4, 0, 1}, {0, 0, 1});
  EXPECT_GT(one.mm_per_pixel.p50, 0);
  for (const Percentiles& values :
       {one.error_mm, one.nearest_baseline_deg, one.widest_baseline_deg}) {
    EXPECT_TRUE(std::isnan(values.p10) && std::isnan(values.p50) && std::isnan(values.p90));
  }
  EXPECT_TRUE(std::isnan(from({4, 0, 1}, {8, 0, 1}).mm_per_pixel.p50)) << "it sees nothing";
}

/// Measures one camera by the command, with a text or with JSON on standard output.
std::string measured_camera(const Vector3d& at, const Vector3d& target, bool json) {
  const test::TemporaryFolder folder;
  const std::string fixed = (folder / "fixed.toml").string();
  save_calib(fixed, {{"cam01", ideal_camera({{6}}, 6, at, target), {}}});
  std::vector<std::string> words = {
      "plan",  "--space=-1.5,-1.5,0,1.5,1.5,2", "--cameras", "1", "--lens", "6", "--fixed", fixed,
      "--out", (folder / "out.toml").string(),  "--moments", "2"};
  if (json) words.emplace_back("--json");
  testing::internal::CaptureStdout();
  const test::CommandOutcome outcome = test::run_command(add_plan, words);
  EXPECT_EQ(outcome.status, kExitDone) << outcome.error;
  return testing::internal::GetCapturedStdout();
}

TEST(PlanCommand, reports_no_accuracy_of_a_single_camera) {
  const Vector3d at(3, 0, 1.5), middle(0, 0, 1), away(6, 0, 2);
  const auto json = nlohmann::json::parse(measured_camera(at, middle, true));
  EXPECT_TRUE(json.at("mm_per_pixel").at("p50").is_number());
  EXPECT_TRUE(json.at("error_mm").at("p50").is_null());
  EXPECT_TRUE(json.at("baseline_deg").at("nearest").at("p50").is_null());
  EXPECT_TRUE(json.at("baseline_deg").at("widest").at("p50").is_null());
  EXPECT_THAT(measured_camera(at, middle, false),
              HasSubstr(" mm per pixel; no point is seen by two cameras\n"));
  EXPECT_THAT(measured_camera(at, away, false), HasSubstr("\nno point is seen by a camera\n"));
}

TEST(PointInformation, of_two_cameras_at_a_right_angle_gives_the_variance_of_triangulation) {
  PointInformation point;
  constexpr float kWeight = 1e6F;  // 1 mm across each ray
  add_camera(point, {2, 0, 0}, kWeight);
  EXPECT_TRUE(std::isinf(variance_along(point, {1, 0, 0})));
  EXPECT_FLOAT_EQ(value_of(point, {1, 0, 0}), kValueOfOne);
  add_camera(point, {0, 3, 0}, kWeight);
  EXPECT_NEAR(variance_along(point, {1, 0, 0}), 1e-6, 1e-9);
  EXPECT_NEAR(variance_along(point, {0, 0, 1}), 0.5e-6, 1e-9);
  add_camera(point, {0, 3, 0}, kWeight, -1);
  EXPECT_TRUE(std::isinf(variance_along(point, {1, 0, 0})));
}

TEST(PointInformation, of_two_cameras_at_one_place_gives_no_accuracy) {
  PointInformation point;
  for (int i = 0; i < 2; ++i) add_camera(point, {0, 3, 0}, 1e6F);
  EXPECT_FLOAT_EQ(value_of(point, {0, 1, 0}), kValueOfTwo);
}

TEST(ActionSamples, stand_on_the_floor_within_the_space_and_repeat_for_a_seed) {
  const ActionSamples action = small_action(3);
  ASSERT_EQ(action.moments.size(), 6U);
  for (const ActionMoment& moment : action.moments) {
    EXPECT_NEAR(moment.extent.min.z(), 0, 0.05);
    EXPECT_LT(moment.extent.center().head<2>().norm(), 2);
  }
  EXPECT_NEAR(static_cast<double>(action.samples.size()), 6 * 80, 6);
  const ActionSamples again = small_action(3), other = small_action(4);
  EXPECT_EQ(action.samples[100].point, again.samples[100].point);
  EXPECT_NE(action.samples[100].point, other.samples[100].point);
}

TEST(ActionSamples, of_a_duel_have_points_of_both_performers) {
  const ActionSamples action = small_action(1, Cast::kDuel);
  const auto second = std::ranges::count(action.samples, 1U, &ActionSample::performer);
  const double share = static_cast<double>(second) / static_cast<double>(action.samples.size());
  EXPECT_NEAR(share, 0.5, 0.1);
}

TEST(CameraCandidates, are_on_their_mount_outside_of_the_space) {
  MountOptions options;
  options.mounts = {Mount::kRail, Mount::kWall, Mount::kCeiling};
  for (const Vector3d& p : candidate_positions(kSpace, options)) {
    EXPECT_FALSE(kSpace.contains(p));
    EXPECT_GE(p.z(), options.low_m);
    EXPECT_LE(p.z(), options.high_m);
    const double side = p.head<2>().cwiseAbs().maxCoeff();
    EXPECT_TRUE(std::abs(side - 3) < 1e-9 || std::abs(p.head<2>().norm() - 3) < 1e-9 ||
                p.z() == options.high_m)
        << p.transpose();
  }
}

TEST(CameraCandidates, have_the_field_of_view_of_their_lens_and_sensor) {
  CandidateLenses lens;
  const CameraModel camera = ideal_camera(lens, 6, {3, 0, 1}, {0, 0, 1});
  const double left = std::acos(camera.viewing_direction().dot(*camera.ray({-0.5, 383.5})));
  EXPECT_NEAR(left, std::atan(0.5 * lens.sensor_width_mm / 6), 1e-9);
}

TEST(CameraPlan, sees_more_surface_than_the_default_rig_at_moments_that_it_was_not_made_for) {
  const std::vector<CameraModel> planned = plan(small_action(1)).cameras;
  const ActionSamples held_out = small_action(2);
  const std::vector<CameraModel> usual = models_of(sim::make_rig(6, {1024, 768}, 1));
  EXPECT_GT(measure_coverage(planned, held_out).two_or_more(),
            measure_coverage(usual, held_out).two_or_more() + 0.05);
}

TEST(CameraPlan, is_not_made_worse_by_exchanges) {
  const CameraPlacement placement = plan(small_action(1));
  EXPECT_GT(placement.exchanges, 0);
  EXPECT_GT(placement.value, placement.greedy_value);
}

TEST(CameraPlan, adds_to_the_fixed_cameras_and_keeps_away_from_them) {
  const ActionSamples action = small_action(1);
  const CameraPlacement free = plan(action);
  const std::vector<CameraModel> fixed(free.cameras.begin(), free.cameras.begin() + 2);
  const CameraPlacement placement = plan(action, fixed);
  ASSERT_EQ(placement.cameras.size(), 4U);
  for (const CameraModel& camera : placement.cameras) {
    for (const CameraModel& other : fixed) {
      EXPECT_GE((camera.center() - other.center()).norm(), kSeparationM);
    }
  }
}

TEST(CameraPlan, names_the_room_that_the_mounts_have) {
  PlacementOptions options = six_cameras();
  options.cameras = 7;
  options.separation_m = 4;
  const std::string message = test::message_of<InputError>(
      [&] { place_cameras(kSpace, small_action(1), {}, options, [] {}); });
  EXPECT_THAT(message, HasSubstr("--cameras 7"));
  EXPECT_THAT(message, HasSubstr("4 m apart"));
}

TEST(PlanPlot, draws_every_camera_in_plan_view_and_elevation) {
  Rig rig;
  for (const char* name : {"cam01", "a<b"}) {
    rig.push_back({name, ideal_camera({{6}}, 6, {3, 0, 1}, {0, 0, 1}), {}});
  }
  const std::string plot = plot_of(rig, 1, kSpace);
  EXPECT_THAT(plot, HasSubstr("cam01"));
  EXPECT_THAT(plot, HasSubstr("a&lt;b"));
  size_t marks = 0;
  for (size_t at = 0; (at = plot.find("<polygon", at)) != std::string::npos; ++at) ++marks;
  EXPECT_EQ(marks, 4U);
}

}  // namespace
}  // namespace v3d::plan
