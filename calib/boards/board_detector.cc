#include "calib/boards/board_detector.h"

#include <algorithm>
#include <array>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "base/demosaic.h"

namespace v3d::calib {
namespace {

namespace aruco = cv::aruco;
constexpr int kFewestCorners = 6;

cv::Ptr<aruco::Dictionary> dictionary_named(const std::string& name) {
  constexpr std::array kNames = {std::pair{"DICT_4X4_50", aruco::DICT_4X4_50},
                                 std::pair{"DICT_4X4_100", aruco::DICT_4X4_100},
                                 std::pair{"DICT_4X4_250", aruco::DICT_4X4_250},
                                 std::pair{"DICT_4X4_1000", aruco::DICT_4X4_1000},
                                 std::pair{"DICT_5X5_50", aruco::DICT_5X5_50},
                                 std::pair{"DICT_5X5_100", aruco::DICT_5X5_100},
                                 std::pair{"DICT_5X5_250", aruco::DICT_5X5_250},
                                 std::pair{"DICT_5X5_1000", aruco::DICT_5X5_1000},
                                 std::pair{"DICT_6X6_50", aruco::DICT_6X6_50},
                                 std::pair{"DICT_6X6_100", aruco::DICT_6X6_100},
                                 std::pair{"DICT_6X6_250", aruco::DICT_6X6_250},
                                 std::pair{"DICT_6X6_1000", aruco::DICT_6X6_1000},
                                 std::pair{"DICT_7X7_50", aruco::DICT_7X7_50},
                                 std::pair{"DICT_7X7_100", aruco::DICT_7X7_100},
                                 std::pair{"DICT_7X7_250", aruco::DICT_7X7_250},
                                 std::pair{"DICT_7X7_1000", aruco::DICT_7X7_1000},
                                 std::pair{"DICT_ARUCO_ORIGINAL", aruco::DICT_ARUCO_ORIGINAL}};
  const auto found =
      std::find_if(kNames.begin(), kNames.end(), [&](const auto& n) { return n.first == name; });
  return aruco::getPredefinedDictionary(found->second);
}

/// One channel; the green pixels of a Bayer image are not told apart from the others, which blurs
/// the corners by less than a pixel and no farther to one side than to the other.
cv::Mat grey_of(ImageView image) {
  const Image rgb = image.format == PixelFormat::kMono8 ? Image() : to_rgb(image);
  cv::Mat grey;
  if (image.format == PixelFormat::kMono8) {
    grey = cv::Mat(image.size.height, image.size.width, CV_8UC1,
                   const_cast<uint8_t*>(image.bytes.data()))
               .clone();
  } else {
    const cv::Mat colour(rgb.size.height, rgb.size.width, CV_8UC3,
                         const_cast<uint8_t*>(rgb.bytes.data()));
    cv::cvtColor(colour, grey, cv::COLOR_RGB2GRAY);
  }
  return grey;
}

struct Markers {
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
};

Markers find_markers(const cv::Mat& grey, const cv::Ptr<aruco::Dictionary>& dictionary) {
  const auto parameters = aruco::DetectorParameters::create();
  Markers markers;
  aruco::detectMarkers(grey, dictionary, markers.corners, markers.ids, parameters);
  return markers;
}

/// All corners, in the order that OpenCV finds them.
std::vector<cv::Point2f> find_grid(const cv::Mat& grey, cv::Size pattern) {
  std::vector<cv::Point2f> points;
  const int flags = cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ACCURACY;
  if (cv::findChessboardCornersSB(grey, pattern, points, flags)) return points;
  const int fast =
      cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK;
  if (!cv::findChessboardCorners(grey, pattern, points, fast)) return {};
  // The window must not reach the neighbouring corner.
  float nearest = 1e9F;
  for (size_t i = 1; i < points.size(); ++i) {
    nearest = std::min(nearest, static_cast<float>(cv::norm(points[i] - points[i - 1])));
  }
  const int half = std::clamp(static_cast<int>(0.4F * nearest), 2, 11);
  cv::cornerSubPix(grey, points, {half, half}, {-1, -1},
                   {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 40, 0.001});
  return points;
}

double cross(const cv::Point2f& a, const cv::Point2f& b) { return a.x * b.y - a.y * b.x; }

/// The rows in reverse where needed, so that the board's z comes out of the print: seen from the
/// front, in an image whose y points down, x turns to y against the clock.
void order_by_handedness(std::vector<cv::Point2f>& points, const Board& board) {
  const int n = board.corner_columns;
  const cv::Point2f x = points[n - 1] - points[0];
  const cv::Point2f y = points[static_cast<size_t>(n) * (board.corner_rows - 1)] - points[0];
  if (cross(x, y) < 0) return;
  for (int row = 0; row < board.corner_rows / 2; ++row) {
    std::swap_ranges(points.begin() + row * n, points.begin() + (row + 1) * n,
                     points.begin() + (board.corner_rows - 1 - row) * n);
  }
}

/// Mean grey value of the squares whose column and row add up to an even number, less that of the
/// others.
double even_less_odd(const cv::Mat& grey, const std::vector<cv::Point2f>& points,
                     const Board& board) {
  double sums[2] = {0, 0};
  int counts[2] = {0, 0};
  for (int row = 0; row + 1 < board.corner_rows; ++row) {
    for (int column = 0; column + 1 < board.corner_columns; ++column) {
      const size_t at = static_cast<size_t>(row) * board.corner_columns + column;
      const cv::Point2f middle = (points[at] + points[at + 1] + points[at + board.corner_columns] +
                                  points[at + board.corner_columns + 1]) /
                                 4;
      const int x = std::clamp(cvRound(middle.x), 0, grey.cols - 1);
      const int y = std::clamp(cvRound(middle.y), 0, grey.rows - 1);
      sums[(row + column) % 2] += grey.at<uint8_t>(y, x);
      ++counts[(row + column) % 2];
    }
  }
  return sums[0] / counts[0] - sums[1] / counts[1];
}

/// Where the two ends differ, the first is the one whose first square is dark.
void order_by_colour(std::vector<cv::Point2f>& points, const cv::Mat& grey, const Board& board) {
  if (board.looks_same_turned()) return;
  if (even_less_odd(grey, points, board) > 0) std::reverse(points.begin(), points.end());
}

/// The corners of a whole chessboard in the board's order; empty for no points.
std::optional<BoardSighting> ordered(std::vector<cv::Point2f> points, const cv::Mat& grey,
                                     const Board& board) {
  if (points.empty()) return std::nullopt;
  order_by_handedness(points, board);
  order_by_colour(points, grey, board);
  BoardSighting sighting;
  for (int i = 0; i < board.corners(); ++i) {
    sighting.corners.push_back(i);
    sighting.pixels.emplace_back(points[i].x, points[i].y);
  }
  return sighting;
}

bool on_one_line(const BoardSighting& sighting, const Board& board) {
  const auto same = [&](auto of) {
    return std::all_of(sighting.corners.begin(), sighting.corners.end(),
                       [&](int c) { return of(c) == of(sighting.corners.front()); });
  };
  return same([&](int c) { return c % board.corner_columns; }) ||
         same([&](int c) { return c / board.corner_columns; });
}

std::string sides(int columns, int rows) {
  return std::to_string(columns) + "x" + std::to_string(rows);
}

/// A chessboard of any size: its inner corners along its sides.
std::optional<cv::Size> any_chessboard(const cv::Mat& grey) {
  std::vector<cv::Point2f> points;
  cv::Mat grid;
  const int flags = cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_LARGER;
  if (!cv::findChessboardCornersSB(grey, {3, 3}, points, flags, grid)) return std::nullopt;
  return cv::Size(grid.cols, grid.rows);
}

std::optional<std::string> explain_chess(const cv::Mat& grey, const Board& board) {
  const auto found = any_chessboard(grey);
  if (!found) return std::nullopt;
  const int longer = std::max(found->width, found->height);
  const int shorter = std::min(found->width, found->height);
  if (longer == std::max(board.corner_columns, board.corner_rows) &&
      shorter == std::min(board.corner_columns, board.corner_rows)) {
    return std::nullopt;
  }
  return "wrong board size: a chessboard of " + sides(longer, shorter) +
         " inner corners is in the picture, not " + sides(board.corner_columns, board.corner_rows) +
         " (count the places where four squares meet)";
}

}  // namespace

struct BoardDetector::Charuco {
  cv::Ptr<aruco::Dictionary> dictionary;
  cv::Ptr<aruco::CharucoBoard> board;
  int columns, rows;  // of corners

  /// OpenCV counts rows from the top, which puts z into the print.
  int from_below(int id) const { return (rows - 1 - id / columns) * columns + id % columns; }

  explicit Charuco(const Board& b)
      : dictionary(dictionary_named(b.dictionary)),
        board(aruco::CharucoBoard::create(b.corner_columns + 1, b.corner_rows + 1,
                                          static_cast<float>(b.square_m),
                                          static_cast<float>(b.marker_m), dictionary)),
        columns(b.corner_columns),
        rows(b.corner_rows) {}

  BoardSighting find(const cv::Mat& grey) const {
    const Markers markers = find_markers(grey, dictionary);
    BoardSighting sighting;
    if (markers.ids.empty()) return sighting;
    std::vector<cv::Point2f> points;
    std::vector<int> ids;
    aruco::interpolateCornersCharuco(markers.corners, markers.ids, grey, board, points, ids);
    std::vector<std::pair<int, Eigen::Vector2d>> corners;
    for (size_t i = 0; i < ids.size(); ++i) {
      corners.emplace_back(from_below(ids[i]), Eigen::Vector2d(points[i].x, points[i].y));
    }
    std::sort(corners.begin(), corners.end(),
              [](const auto& a, const auto& b) { return a.first < b.first; });
    for (const auto& [corner, pixel] : corners) {
      sighting.corners.push_back(corner);
      sighting.pixels.push_back(pixel);
    }
    return sighting;
  }

  std::optional<std::string> explain(const cv::Mat& grey, const Board& b) const {
    constexpr size_t kFew = 3;
    cv::Mat mirrored;
    cv::flip(grey, mirrored, 1);
    const Markers here = find_markers(grey, dictionary);
    if (find_markers(mirrored, dictionary).ids.size() >= kFew + here.ids.size()) {
      return "mirrored print: the markers can be read in a mirror only (print the board again, or "
             "stop the camera from mirroring its pictures)";
    }
    const auto beyond = std::max_element(here.ids.begin(), here.ids.end());
    if (beyond != here.ids.end() && *beyond >= static_cast<int>(board->ids.size())) {
      return "wrong board size: marker " + std::to_string(*beyond) + " is in the picture, and " +
             b.text() + " has markers 0 to " + std::to_string(board->ids.size() - 1);
    }
    const cv::Mat negative = 255 - grey;
    if (here.ids.size() < kFew && find_markers(negative, dictionary).ids.size() >= kFew) {
      return std::string("the print is ") +
             (b.inverted ? "black on white: leave ':inverted' out"
                         : "white on black: write ':inverted' behind the board");
    }
    return explain_by_dictionary(grey, here.ids.size());
  }

  std::optional<std::string> explain_by_dictionary(const cv::Mat& grey, size_t here) const {
    for (const char* name : {"DICT_4X4_1000", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_1000",
                             "DICT_ARUCO_ORIGINAL"}) {
      if (find_markers(grey, dictionary_named(name)).ids.size() >= 3 + here) {
        return "wrong dictionary: the markers are those of " + std::string(name);
      }
    }
    return std::nullopt;
  }
};

BoardDetector::BoardDetector(Board board) : board_(std::move(board)) {
  if (board_.kind == BoardKind::kCharuco) charuco_ = std::make_shared<Charuco>(board_);
}

/// The board seen straight from the front, x to the right and y up, with a margin.
class BoardDetector::Straight {
 public:
  Straight(const Board& board, const CameraModel& camera) : board_(board), camera_(camera) {}

  cv::Mat turn(const cv::Mat& grey) const {
    const cv::Size size(static_cast<int>((board_.corner_columns - 1 + 2 * kMargin) * kPerSquare),
                        static_cast<int>((board_.corner_rows - 1 + 2 * kMargin) * kPerSquare));
    cv::Mat x(size, CV_32FC1), y(size, CV_32FC1), straight;
    for (int v = 0; v < size.height; ++v) {
      for (int u = 0; u < size.width; ++u) {
        const auto pixel = camera_.project(on_board({u, v}));
        x.at<float>(v, u) = pixel ? static_cast<float>(pixel->x()) : -1.F;
        y.at<float>(v, u) = pixel ? static_cast<float>(pixel->y()) : -1.F;
      }
    }
    cv::remap(grey, straight, x, y, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
    return straight;
  }

  /// Back into the image that was turned.
  std::optional<BoardSighting> turn_back(BoardSighting sighting) const {
    for (Eigen::Vector2d& pixel : sighting.pixels) {
      const auto back = camera_.project(on_board(pixel));
      if (!back) return std::nullopt;
      pixel = *back;
    }
    return sighting;
  }

 private:
  static constexpr double kPerSquare = 32;  // pixels
  static constexpr double kMargin = 2.5;    // squares beyond the outermost corners

  Eigen::Vector3d on_board(const Eigen::Vector2d& at) const {
    const double per_pixel = board_.square_m / kPerSquare;
    return {at.x() * per_pixel - kMargin * board_.square_m,
            (board_.corner_rows - 1 + kMargin) * board_.square_m - at.y() * per_pixel, 0};
  }

  const Board& board_;
  const CameraModel& camera_;
};

cv::Mat BoardDetector::prepared(ImageView image) const {
  cv::Mat grey = grey_of(image);
  return board_.inverted ? cv::Mat(255 - grey) : grey;
}

std::optional<BoardSighting> BoardDetector::find_in(const cv::Mat& grey) const {
  if (charuco_) {
    BoardSighting sighting = charuco_->find(grey);
    if (sighting.count() < kFewestCorners || on_one_line(sighting, board_)) return std::nullopt;
    return sighting;
  }
  return ordered(find_grid(grey, {board_.corner_columns, board_.corner_rows}), grey, board_);
}

std::optional<BoardSighting> BoardDetector::find(ImageView image) const {
  return find_in(prepared(image));
}

std::optional<BoardSighting> BoardDetector::find_near(ImageView image,
                                                      const CameraModel& camera) const {
  const Straight straight(board_, camera);
  auto sighting = find_in(straight.turn(prepared(image)));
  return sighting ? straight.turn_back(std::move(*sighting)) : std::nullopt;
}

std::optional<BoardSighting> BoardDetector::find_small(ImageView image) const {
  const cv::Mat grey = prepared(image);
  for (const double scale : {1.0, 2.0}) {
    cv::Mat larger;
    cv::resize(grey, larger, {}, scale, scale, cv::INTER_CUBIC);
    auto sighting = find_in(larger);
    if (!sighting && !charuco_) {
      std::vector<cv::Point2f> points;
      const int flags = cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE;
      const cv::Size pattern(board_.corner_columns, board_.corner_rows);
      if (cv::findChessboardCornersSB(larger, pattern, points, flags)) {
        sighting = ordered(std::move(points), larger, board_);
      }
    }
    if (!sighting) continue;
    // Pixel centres are whole numbers, in either size.
    const Eigen::Vector2d half(0.5, 0.5);
    for (Eigen::Vector2d& pixel : sighting->pixels) pixel = (pixel + half) / scale - half;
    return sighting;
  }
  return std::nullopt;
}

std::optional<std::string> BoardDetector::explain(ImageView image) const {
  const cv::Mat grey = prepared(image);
  return charuco_ ? charuco_->explain(grey, board_) : explain_chess(grey, board_);
}

}  // namespace v3d::calib
