#include "calib/boards/board.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"
namespace v3d::calib {
namespace {

using testing::HasSubstr;

TEST(Board, text_is_parsed_back_to_the_same_text) {
  for (const char* text : {"chess:9x6:25mm", "chess:8x6:115mm:inverted",
                           "charuco:4x5:54mm:40.5mm:DICT_4X4_1000:inverted"}) {
    EXPECT_EQ(parse_board(text).text(), text);
  }
}

TEST(Board, of_charuco_has_one_corner_less_than_squares_along_each_side) {
  const Board board = parse_board("charuco:4x5:54mm:40.5mm:DICT_4X4_50");
  EXPECT_EQ(board.corner_columns, 3);
  EXPECT_EQ(board.corner_rows, 4);
}

TEST(Board, that_is_invalid_is_rejected_with_the_syntax) {
  for (const char* text :
       {"", "chess", "chess:9x6", "chess:9:25mm", "chess:9x6:25", "chess:9x6:0mm", "chess:6x6:25mm",
        "chess:2x6:25mm", "chess:9x6:25mm:upside", "charuco:4x5:54mm:60mm:DICT_4X4_50",
        "charuco:4x5:54mm:40mm:DICT_3X3", "charuco:4x5:54mm:40mm", "circles:4x5:3mm"}) {
    EXPECT_NE(test::message_of<InputError>([&] { parse_board(text); }), "") << text;
  }
  EXPECT_THAT(test::message_of<InputError>([] { parse_board("chess:6x6:25mm"); }),
              HasSubstr("quarter turn"));
  EXPECT_THAT(
      test::message_of<InputError>([] { parse_board("charuco:3x3:60mm:45mm:DICT_4X4_50"); }),
      HasSubstr("4 corners in common; at least 6"));
  EXPECT_EQ(parse_board("charuco:3x4:60mm:45mm:DICT_4X4_50").corner_rows, 3);
  EXPECT_THAT(test::message_of<InputError>([] { parse_board("board"); }),
              HasSubstr("chess:9x6:25mm"));
}

TEST(Board, observation_half_turned_twice_is_unchanged) {
  const Board board = parse_board("chess:8x6:25mm");
  ASSERT_TRUE(board.has_half_turn_symmetry());
  const BoardObservation observation{{0, 1, 47}, {{1, 2}, {3, 4}, {5, 6}}};
  const BoardObservation once = half_turned(board, observation);
  EXPECT_THAT(once.corners, testing::ElementsAre(0, 46, 47));
  EXPECT_EQ(once.pixels.front(), observation.pixels.back());
  EXPECT_EQ(half_turned(board, once).corners, observation.corners);
  EXPECT_FALSE(parse_board("chess:9x6:25mm").has_half_turn_symmetry());
}

}  // namespace
}  // namespace v3d::calib
