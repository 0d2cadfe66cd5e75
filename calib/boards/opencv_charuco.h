// ChArUco boards of OpenCV: what differs between OpenCV 4.6 (Debian 12) and 4.10 (Debian 13).
#pragma once

#include <opencv2/aruco/charuco.hpp>

namespace v3d::calib {

using CharucoDictionary = cv::Ptr<cv::aruco::Dictionary>;
using CharucoBoard = cv::Ptr<cv::aruco::CharucoBoard>;

#if CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR < 7

/// `name`: one of OpenCV's cv::aruco::DICT_*.
inline CharucoDictionary charuco_dictionary(cv::aruco::PREDEFINED_DICTIONARY_NAME name) {
  return cv::aruco::getPredefinedDictionary(name);
}

/// A board of `squares` squares along x and y, of `square_m` metres with markers of `marker_m`.
///
/// The square in the upper left corner is black where the number of rows is odd, and white where it
/// is even, with all versions of OpenCV.
inline CharucoBoard charuco_board(cv::Size squares, float square_m, float marker_m,
                                  const CharucoDictionary& dictionary) {
  return cv::aruco::CharucoBoard::create(squares.width, squares.height, square_m, marker_m,
                                         dictionary);
}

inline size_t marker_count(const CharucoBoard& board) { return board->ids.size(); }

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
  auto board = cv::makePtr<cv::aruco::CharucoBoard>(squares, square_m, marker_m, *dictionary);
  board->setLegacyPattern(true);
  return board;
}

inline size_t marker_count(const CharucoBoard& board) { return board->getIds().size(); }

inline cv::Mat print_of(const CharucoBoard& board, cv::Size size, int margin) {
  cv::Mat print;
  board->generateImage(size, print, margin, 1);
  return print;
}

#endif

}  // namespace v3d::calib
