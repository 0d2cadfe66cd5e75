#include <gtest/gtest.h>

#include "recon/texture/atlas_colours.h"

namespace v3d::recon {
namespace {

/// The colour that the filter shows for a grey vertex.
Rgb8 shown(ColourFilter& filter, uint8_t grey, bool seen = true) {
  std::vector<Rgb8> colours{{grey, grey, grey}};
  const std::vector<uint8_t> is_seen{static_cast<uint8_t>(seen)};
  filter.apply(colours, is_seen);
  return colours[0];
}

TEST(ColourFilter, follows_noise_of_a_vertex_by_a_seventh_and_a_large_change_at_once) {
  ColourFilter filter;
  EXPECT_EQ(shown(filter, 100), (Rgb8{100, 100, 100}));
  EXPECT_EQ(shown(filter, 107), (Rgb8{101, 101, 101}));
  EXPECT_EQ(shown(filter, 100), (Rgb8{101, 101, 101}));
  EXPECT_EQ(shown(filter, 150), (Rgb8{150, 150, 150}));
  EXPECT_EQ(shown(filter, 100), (Rgb8{100, 100, 100})) << "a wrong colour does not stay";
}

TEST(ColourFilter, keeps_the_colour_of_a_vertex_that_no_camera_sees_until_one_does) {
  ColourFilter filter;
  EXPECT_EQ(shown(filter, 100).r, 100);
  EXPECT_EQ(shown(filter, 30, false).r, 100);
  EXPECT_EQ(shown(filter, 60, false).r, 100);
  EXPECT_EQ(shown(filter, 170).r, 170);
}

TEST(ColourFilter, shows_the_first_colour_that_a_camera_sees_at_once) {
  ColourFilter filter;
  EXPECT_EQ(shown(filter, 100, false).r, 100);
  EXPECT_EQ(shown(filter, 110).r, 110);
}

TEST(ColourFilter, filters_each_vertex_alone) {
  ColourFilter filter;
  std::vector<Rgb8> colours{{10, 20, 30}, {100, 100, 100}};
  const std::vector<uint8_t> seen{1, 1};
  filter.apply(colours, seen);
  colours = {{80, 20, 30}, {100, 107, 100}};
  filter.apply(colours, seen);
  EXPECT_EQ(colours, (std::vector<Rgb8>{{80, 20, 30}, {100, 101, 100}}));
}

TEST(ColourFilter, leaves_out_a_pulse_without_colours) {
  ColourFilter filter;
  EXPECT_EQ(shown(filter, 100).r, 100);
  std::vector<Rgb8> none;
  filter.apply(none, {});
  EXPECT_TRUE(none.empty());
  EXPECT_EQ(shown(filter, 107).r, 101);
}

}  // namespace
}  // namespace v3d::recon
