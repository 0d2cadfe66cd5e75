#include "calib/boards/board.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/board_walk_observations.h"

namespace v3d::calib {
namespace {

using testing::HasSubstr;

TEST(Board, is_read_as_it_is_written) {
  for (const char* text : {"chess:9x6:25mm", "chess:8x6:115mm:inverted",
                           "charuco:4x5:54mm:40.5mm:DICT_4X4_1000:inverted"}) {
    EXPECT_EQ(parse_board(text).text(), text);
  }
}

TEST(Board, of_charuco_has_a_corner_less_than_squares_along_each_side) {
  const Board board = parse_board("charuco:4x5:54mm:40.5mm:DICT_4X4_50");
  EXPECT_EQ(board.corner_columns, 3);
  EXPECT_EQ(board.corner_rows, 4);
}

TEST(Board, that_makes_no_sense_is_refused_with_the_syntax) {
  for (const char* text :
       {"", "chess", "chess:9x6", "chess:9:25mm", "chess:9x6:25", "chess:9x6:0mm", "chess:6x6:25mm",
        "chess:2x6:25mm", "chess:9x6:25mm:upside", "charuco:4x5:54mm:60mm:DICT_4X4_50",
        "charuco:4x5:54mm:40mm:DICT_3X3", "charuco:4x5:54mm:40mm", "circles:4x5:3mm"}) {
    EXPECT_NE(refusal_of([&] { parse_board(text); }), "") << text;
  }
  EXPECT_THAT(refusal_of([] { parse_board("chess:6x6:25mm"); }), HasSubstr("turned by a quarter"));
  EXPECT_THAT(refusal_of([] { parse_board("board"); }), HasSubstr("chess:9x6:25mm"));
}

TEST(Board, turned_twice_is_as_before) {
  const Board board = parse_board("chess:8x6:25mm");
  ASSERT_TRUE(board.looks_same_turned());
  const BoardSighting sighting{{0, 1, 47}, {{1, 2}, {3, 4}, {5, 6}}};
  const BoardSighting once = turned(board, sighting);
  EXPECT_THAT(once.corners, testing::ElementsAre(0, 46, 47));
  EXPECT_EQ(once.pixels.front(), sighting.pixels.back());
  EXPECT_EQ(turned(board, once).corners, sighting.corners);
  EXPECT_FALSE(parse_board("chess:9x6:25mm").looks_same_turned());
}

}  // namespace
}  // namespace v3d::calib
