#include "calib/boards/detectors.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/mcc.hpp>
#include <utility>

#include "base/image/colour.h"
#include "calib/boards/opencv_charuco.h"
#include "calib/boards/saddle_fit.h"

namespace v3d::calib {
namespace {

namespace aruco = cv::aruco;

CharucoDictionary dictionary_named(const std::string& name) {
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
  return charuco_dictionary(found->second);
}

/// One grey channel. Demosaicing blurs the corners by less than a pixel, and symmetrically.
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

Markers find_markers(const cv::Mat& grey, const CharucoDictionary& dictionary) {
  const auto parameters = cv::makePtr<aruco::DetectorParameters>();
  Markers markers;
  aruco::detectMarkers(grey, dictionary, markers.corners, markers.ids, parameters);
  return markers;
}

/// Distance, pixels, from each corner of a chessboard to the nearest of its neighbours.
std::vector<float> spacings_of(const std::vector<cv::Point2f>& points, cv::Size pattern) {
  std::vector<float> spacings(points.size(), 1e9F);
  const auto compare = [&](size_t a, size_t b) {
    const auto distance = static_cast<float>(cv::norm(points[a] - points[b]));
    spacings[a] = std::min(spacings[a], distance);
    spacings[b] = std::min(spacings[b], distance);
  };
  const auto columns = static_cast<size_t>(pattern.width);
  for (size_t i = 0; i < points.size(); ++i) {
    if (i % columns > 0) compare(i, i - 1);
    if (i >= columns) compare(i, i - columns);
  }
  return spacings;
}

/// All corners of a chessboard in OpenCV's order; empty where it finds none.
std::vector<cv::Point2f> find_grid(const cv::Mat& grey, cv::Size pattern) {
  std::vector<cv::Point2f> points;
  const int flags = cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ACCURACY;
  const int fast =
      cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK;
  if (!cv::findChessboardCornersSB(grey, pattern, points, flags) &&
      !cv::findChessboardCorners(grey, pattern, points, fast)) {
    return {};
  }
  refine_saddles(grey, spacings_of(points, pattern), kChessSaddles, points);
  return points;
}

double cross(const cv::Point2f& a, const cv::Point2f& b) { return a.x * b.y - a.y * b.x; }

/// Reverses the rows where needed so that z points out of the print: in an image whose y points
/// down, the board's y is then counter-clockwise from its x.
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

/// Mean grey value of the squares with even column + row, minus that of the other squares.
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

/// Without half-turn symmetry, corner 0 is at the end whose first square is dark.
void order_by_colour(std::vector<cv::Point2f>& points, const cv::Mat& grey, const Board& board) {
  if (board.has_half_turn_symmetry()) return;
  if (even_less_odd(grey, points, board) > 0) std::reverse(points.begin(), points.end());
}

/// The corners of a complete chessboard in the board's order; nothing for no points.
std::optional<BoardObservation> ordered(std::vector<cv::Point2f> points, const cv::Mat& grey,
                                        const Board& board) {
  if (points.empty()) return std::nullopt;
  order_by_handedness(points, board);
  order_by_colour(points, grey, board);
  BoardObservation observation;
  for (int i = 0; i < board.corners(); ++i) {
    observation.corners.push_back(i);
    observation.pixels.emplace_back(points[i].x, points[i].y);
  }
  return observation;
}

bool are_collinear(const BoardObservation& observation, const Board& board) {
  const auto same = [&](auto of) {
    return std::all_of(observation.corners.begin(), observation.corners.end(),
                       [&](int c) { return of(c) == of(observation.corners.front()); });
  };
  return same([&](int c) { return c % board.corner_columns; }) ||
         same([&](int c) { return c / board.corner_columns; });
}

std::string sides(int columns, int rows) {
  return std::to_string(columns) + "x" + std::to_string(rows);
}

/// The pattern from which the search for a chessboard of any size grows.
const cv::Size kSeed(3, 3);

/// Inner corners along the sides of a chessboard of any size. It may be a part of a larger one.
std::optional<cv::Size> any_chessboard(const cv::Mat& grey) {
  std::vector<cv::Point2f> points;
  cv::Mat grid;
  const int flags = cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_LARGER;
  if (!cv::findChessboardCornersSB(grey, kSeed, points, flags, grid)) return std::nullopt;
  return cv::Size(grid.cols, grid.rows);
}

std::optional<BoardDiagnosis> diagnose_chess(const cv::Mat& grey, const Board& board) {
  const auto found = any_chessboard(grey);
  if (!found) return std::nullopt;
  const int longer = std::max(found->width, found->height);
  const int shorter = std::min(found->width, found->height);
  if (longer == std::max(board.corner_columns, board.corner_rows) &&
      shorter == std::min(board.corner_columns, board.corner_rows)) {
    return std::nullopt;
  }
  return BoardDiagnosis{.text = "wrong board size: a chessboard of " + sides(longer, shorter) +
                                " inner corners is in the image, not " +
                                sides(board.corner_columns, board.corner_rows) +
                                " (count the points where four squares meet)",
                        .may_be_part = *found == kSeed};
}

/// Mean distance, pixels, of the corners of the markers from their places in `layout`, seen by a
/// camera without distortion. Infinity where no marker is one of the board.
double misfit(const CharucoLayout& layout, const Markers& markers) {
  const auto& places = marker_corners_of(layout.board);
  std::vector<cv::Point2f> on_board, in_image;
  for (size_t i = 0; i < markers.ids.size(); ++i) {
    const auto marker = static_cast<size_t>(markers.ids[i] + layout.first_marker);
    if (marker >= places.size()) continue;
    for (const cv::Point3f& corner : places[marker]) on_board.emplace_back(corner.x, corner.y);
    in_image.insert(in_image.end(), markers.corners[i].begin(), markers.corners[i].end());
  }
  const cv::Mat image_from_board =
      on_board.empty() ? cv::Mat() : cv::findHomography(on_board, in_image);
  if (image_from_board.empty()) return std::numeric_limits<double>::infinity();
  std::vector<cv::Point2f> expected;
  cv::perspectiveTransform(on_board, expected, image_from_board);
  double sum = 0;
  for (size_t i = 0; i < expected.size(); ++i) sum += cv::norm(expected[i] - in_image[i]);
  return sum / static_cast<double>(expected.size());
}

/// The layouts that a board can have. Where the number of rows is even, the square in the upper
/// left corner is black in prints by OpenCV since 4.6, and white in older ones and in those of some
/// sellers.
std::vector<CharucoLayout> layouts_of(const Board& b, const CharucoDictionary& dictionary) {
  const cv::Size squares(b.corner_columns + 1, b.corner_rows + 1);
  const auto square = static_cast<float>(b.square_m), marker = static_cast<float>(b.marker_m);
  std::vector<CharucoLayout> layouts(1);
  layouts[0].board = charuco_board(squares, square, marker, dictionary);
  if (squares.height % 2 == 0) {
    layouts.push_back(white_corner_layout(squares, square, marker, dictionary));
  }
  return layouts;
}

}  // namespace

struct BoardDetector::Charuco {
  CharucoDictionary dictionary;
  std::vector<CharucoLayout> layouts;
  int columns, rows;  // of corners

  /// OpenCV numbers rows from the top, with z into the print; ours start at the bottom.
  int from_below(int id) const { return (rows - 1 - id / columns) * columns + id % columns; }

  explicit Charuco(const Board& b)
      : dictionary(dictionary_named(b.dictionary)),
        layouts(layouts_of(b, dictionary)),
        columns(b.corner_columns),
        rows(b.corner_rows) {}

  /// The layout that agrees best with the markers.
  const CharucoLayout& layout_of(const Markers& markers) const {
    if (layouts.size() == 1) return layouts[0];
    return misfit(layouts[1], markers) < misfit(layouts[0], markers) ? layouts[1] : layouts[0];
  }

  /// Distance, pixels, from each corner to the nearest of its neighbours; 0 without one.
  std::vector<float> spacings_between(const std::vector<cv::Point2f>& points,
                                      const std::vector<int>& ids) const {
    std::vector<float> spacings(points.size(), 0);
    for (size_t i = 0; i < points.size(); ++i) {
      for (size_t j = 0; j < points.size(); ++j) {
        const int apart = std::abs(ids[i] % columns - ids[j] % columns) +
                          std::abs(ids[i] / columns - ids[j] / columns);
        const auto distance = static_cast<float>(cv::norm(points[i] - points[j]));
        if (apart == 1 && (spacings[i] == 0 || distance < spacings[i])) spacings[i] = distance;
      }
    }
    return spacings;
  }

  BoardObservation find(const cv::Mat& grey) const {
    Markers markers = find_markers(grey, dictionary);
    BoardObservation observation;
    if (markers.ids.empty()) return observation;
    const CharucoLayout& layout = layout_of(markers);
    for (int& id : markers.ids) id += layout.first_marker;
    std::vector<cv::Point2f> points;
    std::vector<int> ids;
    aruco::interpolateCornersCharuco(markers.corners, markers.ids, grey, layout.board, points, ids);
    for (int& id : ids) id -= layout.first_corner;
    refine_saddles(grey, spacings_between(points, ids), kCharucoSaddles, points);
    std::vector<std::pair<int, Eigen::Vector2d>> corners;
    for (size_t i = 0; i < ids.size(); ++i) {
      corners.emplace_back(from_below(ids[i]), Eigen::Vector2d(points[i].x, points[i].y));
    }
    std::sort(corners.begin(), corners.end(),
              [](const auto& a, const auto& b) { return a.first < b.first; });
    for (const auto& [corner, pixel] : corners) {
      observation.corners.push_back(corner);
      observation.pixels.push_back(pixel);
    }
    return observation;
  }

  std::optional<BoardDiagnosis> diagnose(const cv::Mat& grey, const Board& b) const {
    constexpr size_t kMinMarkers = 3;
    cv::Mat mirrored;
    cv::flip(grey, mirrored, 1);
    const Markers found = find_markers(grey, dictionary);
    if (find_markers(mirrored, dictionary).ids.size() >= kMinMarkers + found.ids.size()) {
      return BoardDiagnosis{
          "mirrored print: the markers are only readable in the mirrored image (print the board "
          "again, or turn off mirroring in the camera)"};
    }
    const auto beyond = std::max_element(found.ids.begin(), found.ids.end());
    const size_t marker_count = marker_corners_of(layouts[0].board).size();
    if (beyond != found.ids.end() && *beyond >= static_cast<int>(marker_count)) {
      return BoardDiagnosis{"wrong board size: marker " + std::to_string(*beyond) +
                            " is in the image, and " + b.text() + " has markers 0 to " +
                            std::to_string(marker_count - 1)};
    }
    const cv::Mat negative = 255 - grey;
    if (found.ids.size() < kMinMarkers &&
        find_markers(negative, dictionary).ids.size() >= kMinMarkers) {
      return BoardDiagnosis{std::string("the print is ") +
                            (b.inverted ? "black on white: omit ':inverted'"
                                        : "white on black: append ':inverted' to the board")};
    }
    return diagnose_dictionary(grey, found.ids.size());
  }

  std::optional<BoardDiagnosis> diagnose_dictionary(const cv::Mat& grey, size_t found) const {
    for (const char* name : {"DICT_4X4_1000", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_1000",
                             "DICT_ARUCO_ORIGINAL"}) {
      if (find_markers(grey, dictionary_named(name)).ids.size() >= 3 + found) {
        return BoardDiagnosis{"wrong dictionary: the markers belong to " + std::string(name)};
      }
    }
    return std::nullopt;
  }
};

BoardDetector::BoardDetector(Board board) : board_(std::move(board)) {
  if (board_.kind == BoardKind::kCharuco) charuco_ = std::make_shared<Charuco>(board_);
}

/// A rectified image of the board from the front, x to the right and y up, with a margin.
class BoardDetector::FrontalView {
 public:
  FrontalView(const Board& board, const CameraModel& camera) : board_(board), camera_(camera) {}

  cv::Mat rectify(const cv::Mat& grey) const {
    const cv::Size size(static_cast<int>((board_.corner_columns - 1 + 2 * kMargin) * kPerSquare),
                        static_cast<int>((board_.corner_rows - 1 + 2 * kMargin) * kPerSquare));
    cv::Mat x(size, CV_32FC1), y(size, CV_32FC1), frontal;
    for (int v = 0; v < size.height; ++v) {
      for (int u = 0; u < size.width; ++u) {
        const auto pixel = camera_.project(on_board({u, v}));
        x.at<float>(v, u) = pixel ? static_cast<float>(pixel->x()) : -1.F;
        y.at<float>(v, u) = pixel ? static_cast<float>(pixel->y()) : -1.F;
      }
    }
    cv::remap(grey, frontal, x, y, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
    return frontal;
  }

  /// The observation in pixels of the original image.
  std::optional<BoardObservation> unrectify(BoardObservation observation) const {
    for (Eigen::Vector2d& pixel : observation.pixels) {
      const auto back = camera_.project(on_board(pixel));
      if (!back) return std::nullopt;
      pixel = *back;
    }
    return observation;
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

std::optional<BoardObservation> BoardDetector::find_in(const cv::Mat& grey) const {
  if (charuco_) {
    BoardObservation observation = charuco_->find(grey);
    if (observation.count() < kMinObservedCorners || are_collinear(observation, board_))
      return std::nullopt;
    return observation;
  }
  return ordered(find_grid(grey, {board_.corner_columns, board_.corner_rows}), grey, board_);
}

std::optional<BoardObservation> BoardDetector::find(ImageView image) const {
  return find_in(prepared(image));
}

std::optional<BoardObservation> BoardDetector::find_at(ImageView image,
                                                       const CameraModel& camera) const {
  const FrontalView view(board_, camera);
  auto observation = find_in(view.rectify(prepared(image)));
  return observation ? view.unrectify(std::move(*observation)) : std::nullopt;
}

std::optional<BoardObservation> BoardDetector::find_small(ImageView image) const {
  const cv::Mat grey = prepared(image);
  for (const double scale : {1.0, 2.0}) {
    cv::Mat larger;
    cv::resize(grey, larger, {}, scale, scale, cv::INTER_CUBIC);
    auto observation = find_in(larger);
    if (!observation && !charuco_) {
      std::vector<cv::Point2f> points;
      const int flags = cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE;
      const cv::Size pattern(board_.corner_columns, board_.corner_rows);
      if (cv::findChessboardCornersSB(larger, pattern, points, flags)) {
        observation = ordered(std::move(points), larger, board_);
      }
    }
    if (!observation) continue;
    // Pixel centres have integer coordinates in both sizes.
    const Eigen::Vector2d half(0.5, 0.5);
    for (Eigen::Vector2d& pixel : observation->pixels) pixel = (pixel + half) / scale - half;
    return observation;
  }
  return std::nullopt;
}

std::optional<BoardDiagnosis> BoardDetector::diagnose(ImageView image) const {
  const cv::Mat grey = prepared(image);
  return charuco_ ? charuco_->diagnose(grey, board_) : diagnose_chess(grey, board_);
}

namespace {

/// The square root of a linear image. The detector expects gamma-encoded images; in linear ones,
/// dark patches are hard to distinguish.
cv::Mat square_root(ImageView image) {
  Image rgb = to_rgb(image);
  cv::Mat table(1, 256, CV_8U);
  for (int i = 0; i < 256; ++i) {
    table.at<uint8_t>(i) = static_cast<uint8_t>(std::lround(std::sqrt(255.0 * i)));
  }
  const cv::Mat view(rgb.size.height, rgb.size.width, CV_8UC3, rgb.bytes.data());
  cv::Mat bgr;
  cv::cvtColor(view, bgr, cv::COLOR_RGB2BGR);
  cv::LUT(bgr, table, bgr);
  return bgr;
}

/// `table`: from the detector; rows R, G, B for each patch, the mean in column 1.
ChartColours colours_of(const cv::Mat& table) {
  ChartColours colours;
  for (int patch = 0; patch < 24; ++patch) {
    for (int channel = 0; channel < 3; ++channel) {
      const double root = table.at<double>(3 * patch + channel, 1);
      colours[static_cast<size_t>(patch)][channel] = root * root / 255;
    }
  }
  return colours;
}

}  // namespace

std::optional<ChartColours> find_chart(ImageView image) {
  const auto detector = cv::mcc::CCheckerDetector::create();
  try {
    if (!detector->process(square_root(image), cv::mcc::MCC24, 1)) return std::nullopt;
  } catch (const cv::Exception&) {
    return std::nullopt;  // OpenCV asserts on some images without a chart
  }
  const auto chart = detector->getBestColorChecker();
  if (!chart) return std::nullopt;
  const cv::Mat table = chart->getChartsRGB();
  if (table.rows < 72 || table.cols < 2 || table.type() != CV_64F) return std::nullopt;
  return colours_of(table);
}

}  // namespace v3d::calib
