// ChArUco boards of OpenCV: what differs between OpenCV 4.6 (Debian 12) and 4.10 (Debian 13).
#pragma once

#include <opencv2/aruco/charuco.hpp>

namespace v3d::calib {

using CharucoDictionary = cv::Ptr<cv::aruco::Dictionary>;
using CharucoBoard = cv::Ptr<cv::aruco::CharucoBoard>;

/// A printed board as a part of a board of OpenCV.
struct CharucoLayout {
  CharucoBoard board;
  int first_marker = 0;  ///< the marker of `board` that is marker 0 of the print
  int first_corner = 0;  ///< the corner of `board` that is corner 0 of the print
};

#if CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR < 7

/// `name`: one of OpenCV's cv::aruco::DICT_*.
inline CharucoDictionary charuco_dictionary(cv::aruco::PREDEFINED_DICTIONARY_NAME name) {
  return cv::aruco::getPredefinedDictionary(name);
}

/// A board of `squares` squares along x and y, of `square_m` metres with markers of `marker_m`.
///
/// The square in the upper left corner is black.
inline CharucoBoard charuco_board(cv::Size squares, float square_m, float marker_m,
                                  const CharucoDictionary& dictionary) {
  return cv::aruco::CharucoBoard::create(squares.width, squares.height, square_m, marker_m,
                                         dictionary);
}

/// The same with an even number of rows and a white square in the upper left corner, as OpenCV
/// printed boards before 4.6. OpenCV 4.6 has no such board: it is the rows of one with another row
/// above.
inline CharucoLayout white_corner_layout(cv::Size squares, float square_m, float marker_m,
                                         const CharucoDictionary& dictionary) {
  return {
      .board = charuco_board({squares.width, squares.height + 1}, square_m, marker_m, dictionary),
      .first_marker = squares.width / 2,
      .first_corner = squares.width - 1};
}

/// The corners of each marker on the board, metres.
inline const auto& marker_corners_of(const CharucoBoard& board) { return board->objPoints; }

/// The print: `size` pixels with a margin of `margin` pixels.
inline cv::Mat print_of(const CharucoBoard& board, cv::Size size, int margin) {
  cv::Mat print;
  board->draw(size, print, margin, 1);
  return print;
}

#else

inline CharucoDictionary charuco_dictionary(cv::aruco::PredefinedDictionaryType name) {
  return cv::makePtr<cv::aruco::Dictionary>(cv::aruco::getPredefinedDictionary(name));
}

inline CharucoBoard charuco_board(cv::Size squares, float square_m, float marker_m,
                                  const CharucoDictionary& dictionary) {
  return cv::makePtr<cv::aruco::CharucoBoard>(squares, square_m, marker_m, *dictionary);
}

inline CharucoLayout white_corner_layout(cv::Size squares, float square_m, float marker_m,
                                         const CharucoDictionary& dictionary) {
  const CharucoBoard board = charuco_board(squares, square_m, marker_m, dictionary);
  board->setLegacyPattern(true);
  return {.board = board, .first_marker = 0, .first_corner = 0};
}

inline const auto& marker_corners_of(const CharucoBoard& board) { return board->getObjPoints(); }

inline cv::Mat print_of(const CharucoBoard& board, cv::Size size, int margin) {
  cv::Mat print;
  board->generateImage(size, print, margin, 1);
  return print;
}

#endif

}  // namespace v3d::calib
