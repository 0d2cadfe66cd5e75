#include <gtest/gtest.h>

#include <cmath>

#include "recon/shapes.h"
#include "recon/texture/texture.h"

namespace v3d::recon {
namespace {

constexpr std::array<uint8_t, 4> kUnseen{0, 0, 0, 0};

codec::CameraView view(const codec::CameraAxis& axis,
                       std::vector<std::array<uint8_t, 4>> vertices) {
  return {axis, std::move(vertices)};
}

TEST(ViewColours, weight_cameras_by_their_direction_as_in_algorithm_2) {
  const std::vector<codec::CameraView> views{view({codec::kAxisUnits, 0, 0}, {{200, 0, 0, 255}}),
                                             view({0, codec::kAxisUnits, 0}, {{0, 100, 0, 255}})};
  const auto colours = blended_views(std::vector<Rgb8>{{9, 9, 9}}, views, {{1, 0, 0}});
  // Equation (7): the cosines are 1 and 0.
  const double own = std::pow(3, 10), other = std::pow(2, 10);
  EXPECT_NEAR(colours[0].r, 200 * own / (own + other), 0.5);
  EXPECT_NEAR(colours[0].g, 100 * other / (own + other), 0.5);
}

TEST(ViewColours, ignore_cameras_that_do_not_see_a_vertex_and_keep_the_colour_of_unseen_ones) {
  const std::vector<codec::CameraView> views{
      view({codec::kAxisUnits, 0, 0}, {kUnseen, kUnseen}),
      view({0, codec::kAxisUnits, 0}, {{10, 20, 30, 255}, kUnseen})};
  const std::vector<Rgb8> own{{1, 2, 3}, {4, 5, 6}};
  const auto colours = blended_views(own, views, {{1, 0, 0}});
  EXPECT_EQ(colours[0], (Rgb8{10, 20, 30}));
  EXPECT_EQ(colours[1], own[1]);
}

TEST(ViewColours, leave_out_the_rim_where_another_camera_sees_the_vertex_inside) {
  const CameraModel model = shapes::camera({0, -2, 0}, {0, 0, 0}, {64, 48}, 60);
  const Rig rig{{.name = "a", .model = model, .colour = {}},
                {.name = "b", .model = model, .colour = {}}};
  constexpr std::array<uint8_t, 4> kInside{5, 6, 7, 255}, kRim{5, 6, 7, 128};
  const std::vector<CameraColours> colours{{"a", {kInside, kRim, kRim, kUnseen}},
                                           {"b", {kUnseen, kInside, kUnseen, kUnseen}}};
  const auto views = camera_views(colours, rig);
  ASSERT_EQ(views.size(), 2U);
  EXPECT_NEAR(views[0].axis[1], codec::kAxisUnits, 1);
  EXPECT_EQ(views[0].vertices[0], kInside);
  EXPECT_EQ(views[0].vertices[1], kUnseen);
  EXPECT_EQ(views[0].vertices[2], kInside);  // no camera sees it better
  EXPECT_EQ(views[0].vertices[3], kUnseen);
  EXPECT_EQ(views[1].vertices[1], kInside);
}

}  // namespace
}  // namespace v3d::recon
