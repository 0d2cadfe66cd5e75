// v3d-board-corners: errors of the corners of drawn chessboards (docs/calibration.md).
//
// Prints a table in Markdown: RMS error against the truth, pixels, of the detector alone, of
// cv::cornerSubPix and of the saddles, over eight boards in each row.
#include <fmt/core.h>

#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "calib/boards/saddle_fit.h"
#include "support/drawn_board.h"

namespace v3d {
namespace {

constexpr int kBoards = 8;
constexpr double kMaxTilt = 0.8;      // radians
constexpr double kWindowShare = 0.3;  // half window of cornerSubPix, of the spacing

struct Row {
  test::BoardView view;
  bool is_jpeg = false;
};

/// Squared errors of points, in any order of rows and columns that findChessboardCornersSB uses.
struct Errors {
  double sum = 0;
  int count = 0;
  void add(const std::vector<cv::Point2f>& found, const std::vector<cv::Point2f>& truth) {
    double same = 0, reversed = 0;
    for (size_t i = 0; i < truth.size(); ++i) {
      const cv::Point2f a = found[i] - truth[i], b = found[truth.size() - 1 - i] - truth[i];
      same += a.dot(a);
      reversed += b.dot(b);
    }
    sum += std::min(same, reversed);
    count += static_cast<int>(truth.size());
  }
  double rms() const { return std::sqrt(sum / count); }
};

cv::Mat through_jpeg(const cv::Mat& grey) {
  std::vector<uint8_t> bytes;
  cv::imencode(".jpg", grey, bytes, {cv::IMWRITE_JPEG_QUALITY, 80});
  return cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
}

void sub_pixel(const cv::Mat& grey, const std::vector<float>& spacings,
               std::vector<cv::Point2f>& points) {
  for (size_t i = 0; i < points.size(); ++i) {
    const int half = std::max(2, static_cast<int>(std::lround(kWindowShare * spacings[i])));
    std::vector<cv::Point2f> point = {points[i]};
    cv::cornerSubPix(grey, point, {half, half}, {-1, -1},
                     {cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 50, 1e-3});
    points[i] = point[0];
  }
}

/// As calib/boards/detectors.cc finds them, without their refinement; empty where it finds none.
std::vector<cv::Point2f> detected(const cv::Mat& grey) {
  const cv::Size pattern(test::BoardView::kColumns, test::BoardView::kRows);
  std::vector<cv::Point2f> points;
  const bool is_found =
      cv::findChessboardCornersSB(grey, pattern, points,
                                  cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ACCURACY) ||
      cv::findChessboardCorners(grey, pattern, points,
                                cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE);
  if (!is_found) points.clear();
  return points;
}

void print(const Row& row) {
  std::mt19937 random(1);
  Errors detector, window, saddle;
  int found = 0;
  for (int board = 0; board < kBoards; ++board) {
    test::BoardView view = row.view;
    view.tilt_rad = kMaxTilt * (2.0 * board / (kBoards - 1) - 1);
    test::BoardPicture picture = test::drawn_board(view, random);
    if (row.is_jpeg) picture.grey = through_jpeg(picture.grey);
    std::vector<cv::Point2f> points = detected(picture.grey);
    if (points.empty()) continue;
    ++found;
    detector.add(points, picture.corners);
    std::vector<cv::Point2f> refined = points;
    sub_pixel(picture.grey, picture.spacings, refined);
    window.add(refined, picture.corners);
    refined = points;
    calib::refine_saddles(picture.grey, picture.spacings, calib::kChessSaddles, refined);
    saddle.add(refined, picture.corners);
  }
  fmt::print("| {:g} px{} | {:g} px, {:g} | {} of {} | {:.3f} | {:.3f} | {:.3f} |\n",
             row.view.square_px, row.is_jpeg ? ", JPEG" : "", row.view.blur_px, row.view.noise,
             found, kBoards, detector.rms(), window.rms(), saddle.rms());
}

}  // namespace
}  // namespace v3d

int main() {
  using v3d::test::BoardView;
  fmt::print(
      "| spacing | blur, noise (grey values) | boards | detector alone | `cornerSubPix` | saddle "
      "|\n"
      "| --- | --- | --- | --- | --- | --- |\n");
  for (const v3d::Row& row : {
           v3d::Row{.view = {.square_px = 45, .blur_px = 0.6, .noise = 3}},
           v3d::Row{.view = {.square_px = 40, .blur_px = 0.8, .noise = 4}, .is_jpeg = true},
           v3d::Row{.view = {.square_px = 25, .blur_px = 0.8, .noise = 4}},
           v3d::Row{.view = {.square_px = 14, .blur_px = 0.7, .noise = 4}},
           v3d::Row{.view = {.square_px = 14, .blur_px = 1.3, .noise = 4}},
           v3d::Row{.view = {.square_px = 35, .blur_px = 2.5, .noise = 3}},
           v3d::Row{.view = {.square_px = 30, .blur_px = 0.7, .noise = 10}},
           v3d::Row{.view = {.square_px = 10, .blur_px = 0.6, .noise = 3}},
       }) {
    v3d::print(row);
  }
}
