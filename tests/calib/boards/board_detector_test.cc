#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "calib/boards/detectors.h"
#include "calib/boards/opencv_charuco.h"

namespace v3d::calib {
namespace {

using testing::HasSubstr;

constexpr int kSquare = 40;  // pixels
constexpr char kCharuco[] = "charuco:4x5:40mm:30mm:DICT_4X4_50";

Image to_image(const cv::Mat& grey) {
  Image image({grey.cols, grey.rows}, PixelFormat::kMono8);
  std::copy(grey.datastart, grey.dataend, image.bytes.begin());
  return image;
}

/// A chessboard with a margin of one square. The inner square of the first corner is dark.
cv::Mat print_chess(int corner_columns, int corner_rows) {
  cv::Mat formatted((corner_rows + 3) * kSquare, (corner_columns + 3) * kSquare, CV_8UC1, 255);
  for (int row = 0; row <= corner_rows; ++row) {
    for (int column = 0; column <= corner_columns; ++column) {
      if ((row + column) % 2 == 1) continue;
      formatted(cv::Rect((column + 1) * kSquare, (row + 1) * kSquare, kSquare, kSquare)) = 20;
    }
  }
  return formatted;
}

cv::Mat print_charuco(int columns, int rows) {
  const auto dictionary = charuco_dictionary(cv::aruco::DICT_4X4_50);
  const auto board = charuco_board({columns, rows}, 0.04F, 0.03F, dictionary);
  return print_of(board, {(columns + 2) * kSquare, (rows + 2) * kSquare}, kSquare);
}

/// The same with a white square in the upper left corner, where OpenCV prints a black one since
/// version 4.6.
cv::Mat print_white_corner(int columns, int rows) {
  const cv::Mat usual = print_charuco(columns, rows);
  const auto square = [](const cv::Mat& print, int column, int row) {
    return print(cv::Rect((column + 1) * kSquare, (row + 1) * kSquare, kSquare, kSquare));
  };
  std::vector<cv::Mat> markers;
  for (int i = 0; i < columns * rows; ++i) {
    const int column = i % columns, row = i / columns;
    if ((row + column) % 2 == 1) markers.push_back(square(usual, column, row));
  }
  cv::Mat print(usual.size(), CV_8UC1, 255);
  size_t next = 0;
  for (int i = 0; i < columns * rows; ++i) {
    const int column = i % columns, row = i / columns;
    if ((row + column) % 2 == 1) {
      square(print, column, row) = 0;
    } else {
      markers[next++].copyTo(square(print, column, row));
    }
  }
  return print;
}

/// An oblique view on a grey background, by the homography of the four corners of the print.
struct Photo {
  cv::Mat grey;
  cv::Mat image_from_print;
};

Photo photograph(const cv::Mat& formatted) {
  const float w = static_cast<float>(formatted.cols), h = static_cast<float>(formatted.rows);
  const std::vector<cv::Point2f> from = {{0, 0}, {w, 0}, {w, h}, {0, h}};
  const std::vector<cv::Point2f> to = {{90, 70}, {560, 40}, {520, 420}, {120, 440}};
  Photo photo;
  photo.image_from_print = cv::getPerspectiveTransform(from, to);
  cv::warpPerspective(formatted, photo.grey, photo.image_from_print, {640, 480}, cv::INTER_AREA,
                      cv::BORDER_CONSTANT, 128);
  cv::GaussianBlur(photo.grey, photo.grey, {3, 3}, 0.7);
  return photo;
}

Eigen::Vector2d in_photo(const Photo& photo, double x, double y) {
  // Pixel centres have integer coordinates; the edge between two pixels is at a half.
  const std::vector<cv::Point2d> from = {{x - 0.5, y - 0.5}};
  std::vector<cv::Point2d> to;
  cv::perspectiveTransform(from, to, photo.image_from_print);
  return {to[0].x, to[0].y};
}

double handedness(const BoardObservation& s, const Board& board) {
  const Eigen::Vector2d x = s.pixels[1] - s.pixels[0];
  const Eigen::Vector2d y = s.pixels[board.corner_columns] - s.pixels[0];
  return x.x() * y.y() - x.y() * y.x();
}

std::string diagnosis_by(const BoardDetector& detector, const Image& image) {
  return detector.diagnose(image.view()).value_or(BoardDiagnosis()).text;
}

TEST(BoardDetector, finds_every_corner_of_a_chessboard_within_a_tenth_of_a_pixel) {
  const BoardDetector detector(parse_board("chess:9x6:25mm"));
  const Photo photo = photograph(print_chess(9, 6));
  const auto found = detector.find(to_image(photo.grey).view());
  ASSERT_TRUE(found);
  ASSERT_EQ(found->count(), 54);
  // Corner 0 is one whose inner square is dark; y points up.
  EXPECT_LT(handedness(*found, detector.board()), 0) << "z must point out of the print";
  double sum = 0;
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 9; ++column) {
      const Eigen::Vector2d truth = in_photo(photo, (column + 2) * kSquare, (row + 2) * kSquare);
      double nearest = 1e9;
      for (const auto& pixel : found->pixels) nearest = std::min(nearest, (pixel - truth).norm());
      EXPECT_LT(nearest, 0.25);
      sum += nearest * nearest;
    }
  }
  RecordProperty("rms_px", std::to_string(std::sqrt(sum / 54)));
  EXPECT_LT(std::sqrt(sum / 54), 0.1);
}

/// Root mean square distance, pixels, of the corners of a ChArUco board from the truth; NaN where
/// not all are found.
double charuco_error(const std::string& text, const cv::Mat& print) {
  const BoardDetector detector(parse_board(text));
  const Board& board = detector.board();
  const Photo photo = photograph(print);
  const auto found = detector.find(to_image(photo.grey).view());
  if (!found || found->count() != board.corners()) return std::nan("");
  double sum = 0;
  for (int i = 0; i < found->count(); ++i) {
    const int column = found->corners[i] % board.corner_columns;
    const int row_from_top = board.corner_rows - 1 - found->corners[i] / board.corner_columns;
    const Eigen::Vector2d truth =
        in_photo(photo, (column + 2) * kSquare, (row_from_top + 2) * kSquare);
    sum += (found->pixels[i] - truth).squaredNorm();
  }
  return std::sqrt(sum / found->count());
}

TEST(BoardDetector, finds_corners_between_markers_within_a_tenth_of_a_pixel) {
  const double rms = charuco_error(kCharuco, print_charuco(4, 5));
  RecordProperty("rms_px", std::to_string(rms));
  EXPECT_LT(rms, 0.1);
}

TEST(BoardDetector, finds_boards_with_an_even_number_of_rows_printed_by_old_and_new_opencv) {
  for (const int columns : {4, 5}) {
    const std::string board = "charuco:" + std::to_string(columns) + "x6:40mm:30mm:DICT_4X4_50";
    EXPECT_LT(charuco_error(board, print_charuco(columns, 6)), 0.1) << board;
    EXPECT_LT(charuco_error(board, print_white_corner(columns, 6)), 0.1) << board;
  }
}

TEST(BoardDetector, starts_at_the_same_corner_when_the_image_is_rotated_by_half_a_turn) {
  const BoardDetector detector(parse_board("chess:9x6:25mm"));
  const cv::Mat upright = photograph(print_chess(9, 6)).grey;
  cv::Mat over;
  cv::rotate(upright, over, cv::ROTATE_180);
  const auto a = detector.find(to_image(upright).view());
  const auto b = detector.find(to_image(over).view());
  ASSERT_TRUE(a && b);
  for (int i = 0; i < 54; ++i) {
    EXPECT_NEAR(a->pixels[i].x(), 639 - b->pixels[i].x(), 0.1);
    EXPECT_NEAR(a->pixels[i].y(), 479 - b->pixels[i].y(), 0.1);
  }
}

TEST(BoardDetector, numbers_charuco_corners_correctly_when_half_the_board_is_hidden) {
  const BoardDetector detector(parse_board(kCharuco));
  Photo photo = photograph(print_charuco(4, 5));
  const auto whole = detector.find(to_image(photo.grey).view());
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->count(), 12);
  EXPECT_LT(handedness(*whole, detector.board()), 0) << "z must point out of the print";
  photo.grey(cv::Rect(0, 0, 640, 190)) = 128;
  const auto half = detector.find(to_image(photo.grey).view());
  ASSERT_TRUE(half);
  EXPECT_LT(half->count(), 12);
  for (int i = 0; i < half->count(); ++i) {
    EXPECT_LT((half->pixels[i] - whole->pixels[half->corners[i]]).norm(), 0.5);
  }
}

TEST(BoardDetector, finds_inverted_prints_only_when_the_board_is_marked_inverted) {
  const Image inverted = to_image(255 - photograph(print_charuco(4, 5)).grey);
  EXPECT_TRUE(
      BoardDetector(parse_board(std::string(kCharuco) + ":inverted")).find(inverted.view()));
  const BoardDetector wrong(parse_board(kCharuco));
  EXPECT_FALSE(wrong.find(inverted.view()));
  EXPECT_THAT(diagnosis_by(wrong, inverted), HasSubstr("':inverted'"));
}

TEST(BoardDetector, reports_a_mirrored_print) {
  cv::Mat mirrored;
  cv::flip(print_charuco(4, 5), mirrored, 1);
  const Image image = to_image(photograph(mirrored).grey);
  const BoardDetector detector(parse_board(kCharuco));
  EXPECT_FALSE(detector.find(image.view()));
  EXPECT_THAT(diagnosis_by(detector, image), HasSubstr("mirrored print"));
}

TEST(BoardDetector, reports_a_chessboard_of_another_size) {
  const Image image = to_image(photograph(print_chess(8, 5)).grey);
  const BoardDetector detector(parse_board("chess:9x6:25mm"));
  EXPECT_FALSE(detector.find(image.view()));
  EXPECT_THAT(diagnosis_by(detector, image),
              HasSubstr("wrong board size: a chessboard of 8x5 inner corners"));
}

TEST(BoardDetector, reports_a_charuco_board_with_more_markers) {
  const Image image = to_image(photograph(print_charuco(6, 8)).grey);
  EXPECT_THAT(diagnosis_by(BoardDetector(parse_board(kCharuco)), image),
              HasSubstr("wrong board size: marker 23"));
}

TEST(BoardDetector, reports_markers_of_another_dictionary) {
  const Image image = to_image(photograph(print_charuco(4, 5)).grey);
  const BoardDetector detector(parse_board("charuco:4x5:40mm:30mm:DICT_6X6_50"));
  EXPECT_THAT(diagnosis_by(detector, image), HasSubstr("DICT_4X4_1000"));
}

TEST(BoardDetector, reports_nothing_for_an_image_without_a_board) {
  const Image grey({640, 480}, PixelFormat::kMono8);
  for (const char* text : {"chess:9x6:25mm", kCharuco}) {
    const BoardDetector detector(parse_board(text));
    EXPECT_FALSE(detector.find(grey.view()));
    EXPECT_FALSE(detector.diagnose(grey.view()));
  }
}

}  // namespace
}  // namespace v3d::calib
