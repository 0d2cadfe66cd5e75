#include "calib/boards/board.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <optional>

#include "base/core/error.h"
#include "base/core/text.h"

namespace v3d::calib {
namespace {

constexpr int kMaxSquares = 200;
constexpr std::array kDictionaries = {
    "DICT_4X4_50",   "DICT_4X4_100",       "DICT_4X4_250",  "DICT_4X4_1000", "DICT_5X5_50",
    "DICT_5X5_100",  "DICT_5X5_250",       "DICT_5X5_1000", "DICT_6X6_50",   "DICT_6X6_100",
    "DICT_6X6_250",  "DICT_6X6_1000",      "DICT_7X7_50",   "DICT_7X7_100",  "DICT_7X7_250",
    "DICT_7X7_1000", "DICT_ARUCO_ORIGINAL"};

[[noreturn]] void fail(std::string_view text, const std::string& why) {
  throw InputError(
      "board '" + std::string(text) + "': " + why +
      "; expected chess:9x6:25mm (inner corners) or charuco:4x5:54mm:40.5mm:DICT_4X4_50 "
      "(squares), with :inverted for a white-on-black print");
}

std::vector<std::string> split(std::string_view text) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == ':') {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

std::optional<int> whole_number(std::string_view text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// "9x6".
std::pair<int, int> parse_sides(std::string_view text, std::string_view sides) {
  const size_t x = sides.find('x');
  if (x != std::string_view::npos) {
    const auto a = whole_number(sides.substr(0, x));
    const auto b = whole_number(sides.substr(x + 1));
    if (a && b && *a >= 3 && *b >= 3 && *a <= kMaxSquares && *b <= kMaxSquares) return {*a, *b};
  }
  fail(text, "'" + std::string(sides) + "' is not COLUMNSxROWS, each from 3 to " +
                 std::to_string(kMaxSquares));
}

double parse_side(std::string_view text, const std::string& length) {
  const double metres = parse_length(length);
  if (!(metres > 0)) fail(text, "'" + length + "' is not a positive length");
  return metres;
}

Board parse_chess(std::string_view text, const std::vector<std::string>& parts) {
  if (parts.size() != 3) fail(text, "expected chess:COLUMNSxROWS:SQUARE");
  Board board;
  std::tie(board.corner_columns, board.corner_rows) = parse_sides(text, parts[1]);
  if (board.corner_columns == board.corner_rows) {
    fail(text,
         "a square board looks the same after a quarter turn; use different numbers of columns and "
         "rows");
  }
  board.square_m = parse_side(text, parts[2]);
  return board;
}

Board parse_charuco(std::string_view text, const std::vector<std::string>& parts) {
  if (parts.size() != 5) fail(text, "expected charuco:COLUMNSxROWS:SQUARE:MARKER:DICT");
  Board board;
  board.kind = BoardKind::kCharuco;
  const auto [columns, rows] = parse_sides(text, parts[1]);
  board.corner_columns = columns - 1;
  board.corner_rows = rows - 1;
  if (board.corner_columns * board.corner_rows < kMinObservedCorners) {
    fail(text, "its squares have " + std::to_string(board.corner_columns * board.corner_rows) +
                   " corners in common; at least " + std::to_string(kMinObservedCorners) +
                   " are needed to find it");
  }
  board.square_m = parse_side(text, parts[2]);
  board.marker_m = parse_side(text, parts[3]);
  if (board.marker_m >= board.square_m) fail(text, "the marker must be smaller than its square");
  board.dictionary = parts[4];
  if (std::find(kDictionaries.begin(), kDictionaries.end(), parts[4]) == kDictionaries.end()) {
    fail(text, "unknown dictionary '" + parts[4] + "'");
  }
  return board;
}

}  // namespace

std::string Board::text() const {
  const int extra = kind == BoardKind::kChess ? 0 : 1;
  std::string text = kind == BoardKind::kChess ? "chess:" : "charuco:";
  text += std::to_string(corner_columns + extra) + "x" + std::to_string(corner_rows + extra);
  const auto add_length = [&](double metres) {
    std::string length = format_length(metres);
    length.erase(std::remove(length.begin(), length.end(), ' '), length.end());
    text += ":" + length;
  };
  add_length(square_m);
  if (kind == BoardKind::kCharuco) {
    add_length(marker_m);
    text += ":" + dictionary;
  }
  return text + (inverted ? ":inverted" : "");
}

Board parse_board(std::string_view text) {
  std::vector<std::string> parts = split(text);
  const bool inverted = parts.size() > 1 && parts.back() == "inverted";
  if (inverted) parts.pop_back();
  if (parts[0] != "chess" && parts[0] != "charuco") fail(text, "unknown kind of board");
  Board board = parts[0] == "chess" ? parse_chess(text, parts) : parse_charuco(text, parts);
  board.inverted = inverted;
  return board;
}

BoardObservation half_turned(const Board& board, const BoardObservation& observation) {
  V3D_CHECK(board.has_half_turn_symmetry());
  BoardObservation other;
  for (int i = observation.count() - 1; i >= 0; --i) {
    other.corners.push_back(board.corners() - 1 - observation.corners[i]);
    other.pixels.push_back(observation.pixels[i]);
  }
  return other;
}

namespace {

double pixel_distance(const BoardObservation& a, const BoardObservation& b) {
  double sum = 0;
  for (int i = 0; i < std::min(a.count(), b.count()); ++i)
    sum += (a.pixels[i] - b.pixels[i]).norm();
  return sum;
}

}  // namespace

BoardObservation turned_like(const BoardObservation& reference, const Board& board,
                             const BoardObservation& observation) {
  if (!board.has_half_turn_symmetry()) return observation;
  BoardObservation other = half_turned(board, observation);
  const bool is_nearer = pixel_distance(other, reference) < pixel_distance(observation, reference);
  return is_nearer ? other : observation;
}

namespace {

/// Corners in the board frame, and their undistorted, normalised image coordinates (x/z, y/z).
struct PlanarPoints {
  std::vector<cv::Point3d> board;
  std::vector<cv::Point2d> seen;
};

PlanarPoints planar_points(const CameraModel& camera, const Board& board,
                           const BoardObservation& observation) {
  PlanarPoints points;
  const Eigen::Matrix3d& cam_from_world = camera.cam_from_world().rotation;
  for (int i = 0; i < observation.count(); ++i) {
    const auto in_world = camera.ray(observation.pixels[i]);
    if (!in_world) continue;
    const Eigen::Vector3d ray = cam_from_world * *in_world;
    // The planar solver requires coordinates relative to the board's centre.
    const Eigen::Vector3d corner = board.corner(observation.corners[i]) - board.centre();
    points.board.emplace_back(corner.x(), corner.y(), corner.z());
    points.seen.emplace_back(ray.x() / ray.z(), ray.y() / ray.z());
  }
  return points;
}

RigidTransform to_transform(const cv::Mat& rotation, const cv::Mat& translation) {
  const auto vector = [](const cv::Mat& m) {
    return Eigen::Vector3d(m.at<double>(0), m.at<double>(1), m.at<double>(2));
  };
  return RigidTransform::from_rodrigues(vector(rotation), vector(translation));
}

}  // namespace

CameraModel with_pose(const CameraModel& lens, const RigidTransform& cam_from_world) {
  return {lens.size(), lens.matrix(), lens.distortion(), cam_from_world};
}

double rms_of(std::span<const Eigen::Vector2d> residuals) {
  double sum = 0;
  for (const Eigen::Vector2d& residual : residuals) sum += residual.squaredNorm();
  return residuals.empty() ? 0 : std::sqrt(sum / static_cast<double>(residuals.size()));
}

std::vector<Eigen::Vector2d> residuals(const CameraModel& camera, const Board& board,
                                       const RigidTransform& cam_from_board,
                                       const BoardObservation& observation) {
  // Keep this camera: a new one computes the range of its lens again, which takes longer than the
  // projections.
  const RigidTransform world_from_board = camera.cam_from_world().inverse() * cam_from_board;
  std::vector<Eigen::Vector2d> result;
  for (int i = 0; i < observation.count(); ++i) {
    const auto pixel = camera.project(world_from_board * board.corner(observation.corners[i]));
    result.push_back(pixel ? Eigen::Vector2d(observation.pixels[i] - *pixel)
                           : Eigen::Vector2d(1e6, 1e6));
  }
  return result;
}

std::vector<BoardPose> board_poses(const CameraModel& camera, const Board& board,
                                   const BoardObservation& observation) {
  const PlanarPoints points = planar_points(camera, board, observation);
  if (points.board.size() < 4) return {};
  std::vector<cv::Mat> rotations, translations;
  const cv::Matx33d identity = cv::Matx33d::eye();
  try {
    cv::solvePnPGeneric(points.board, points.seen, identity, cv::noArray(), rotations, translations,
                        false, cv::SOLVEPNP_IPPE);
  } catch (const cv::Exception&) {
    return {};  // collinear corners
  }
  std::vector<BoardPose> poses;
  for (size_t i = 0; i < rotations.size(); ++i) {
    const RigidTransform pose = to_transform(rotations[i], translations[i]) *
                                RigidTransform{Eigen::Matrix3d::Identity(), -board.centre()};
    // A board behind the camera cannot have been observed.
    const bool in_front = (pose * board.centre()).z() > 0;
    if (!in_front) continue;
    poses.push_back({pose, rms_of(residuals(camera, board, pose, observation))});
  }
  std::sort(poses.begin(), poses.end(),
            [](const BoardPose& a, const BoardPose& b) { return a.rms_px < b.rms_px; });
  return poses;
}

Eigen::Matrix3d initial_camera_matrix(const Board& board, ImageSize size,
                                      std::span<const BoardObservation* const> observations) {
  std::vector<std::vector<cv::Point3f>> corners;
  std::vector<std::vector<cv::Point2f>> pixels;
  for (const BoardObservation* observation : observations) {
    auto& view_corners = corners.emplace_back();
    auto& view_pixels = pixels.emplace_back();
    for (int i = 0; i < observation->count(); ++i) {
      const Eigen::Vector3d c = board.corner(observation->corners[i]);
      view_corners.emplace_back(static_cast<float>(c.x()), static_cast<float>(c.y()), 0.F);
      view_pixels.emplace_back(static_cast<float>(observation->pixels[i].x()),
                               static_cast<float>(observation->pixels[i].y()));
    }
  }
  const cv::Mat k = cv::initCameraMatrix2D(corners, pixels, {size.width, size.height}, 1.0);
  const double widest = std::max(size.width, size.height);
  double focal = k.at<double>(0, 0);
  // Frontal views do not determine the focal length; then use that of a common lens.
  if (!std::isfinite(focal) || focal < 0.2 * widest || focal > 20 * widest) focal = widest;
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  matrix(0, 0) = matrix(1, 1) = focal;
  matrix(0, 2) = 0.5 * (size.width - 1);
  matrix(1, 2) = 0.5 * (size.height - 1);
  return matrix;
}

namespace {

/// Position in the image (2), distance (1) and tilt (2) of a board; each is about 0 to 1.
using ViewDescriptor = Eigen::Matrix<double, 5, 1>;
constexpr double kMinDistance = 0.015;

/// The parameters of the best affine map from board to image, which needs no lens model.
ViewDescriptor describe_view(const Board& board, ImageSize size,
                             const BoardObservation& observation) {
  const int n = observation.count();
  Eigen::MatrixXd from(n, 3), to(n, 2);
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d corner = board.corner(observation.corners[i]) / board.square_m;
    from.row(i) << corner.x(), corner.y(), 1;
    to.row(i) = observation.pixels[i].transpose();
  }
  const Eigen::MatrixXd map = from.colPivHouseholderQr().solve(to);
  const Eigen::Matrix2d a = map.topRows<2>().transpose();
  const double area = std::max(std::abs(a.determinant()), 1e-6);
  const Eigen::Matrix2d stretch = a * a.transpose() / area;
  const Eigen::Vector2d middle = to.colwise().mean().transpose();
  ViewDescriptor descriptors;
  descriptors << middle.x() / size.width, middle.y() / size.height, 0.25 * std::log(area),
      0.25 * (stretch(0, 0) - stretch(1, 1)), 0.5 * stretch(0, 1);
  return descriptors;
}

}  // namespace

std::vector<int> select_views(const Board& board, ImageSize size,
                              std::span<const BoardObservation* const> observations,
                              int max_views) {
  std::vector<ViewDescriptor> descriptors;
  for (const BoardObservation* s : observations)
    descriptors.push_back(describe_view(board, size, *s));
  const auto largest = std::max_element(observations.begin(), observations.end(),
                                        [](auto* a, auto* b) { return a->count() < b->count(); });
  std::vector<int> chosen;
  std::vector<double> distance(observations.size(), std::numeric_limits<double>::infinity());
  auto next = static_cast<size_t>(largest - observations.begin());
  while (std::ssize(chosen) < max_views && next < observations.size() &&
         distance[next] > kMinDistance) {
    chosen.push_back(static_cast<int>(next));
    for (size_t i = 0; i < descriptors.size(); ++i) {
      distance[i] = std::min(distance[i], (descriptors[i] - descriptors[next]).norm());
    }
    next =
        static_cast<size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

std::vector<int> coverage_counts(ImageSize size,
                                 std::span<const BoardObservation* const> observations) {
  std::vector<int> counts(kCoverageColumns * kCoverageRows);
  for (const BoardObservation* observation : observations) {
    for (const Eigen::Vector2d& pixel : observation->pixels) {
      const int x = static_cast<int>((pixel.x() + 0.5) / size.width * kCoverageColumns);
      const int y = static_cast<int>((pixel.y() + 0.5) / size.height * kCoverageRows);
      ++counts[std::clamp(y, 0, kCoverageRows - 1) * kCoverageColumns +
               std::clamp(x, 0, kCoverageColumns - 1)];
    }
  }
  return counts;
}

double coverage(ImageSize size, std::span<const BoardObservation* const> observations) {
  const std::vector<int> counts = coverage_counts(size, observations);
  const auto seen = std::count_if(counts.begin(), counts.end(), [](int n) { return n > 0; });
  return static_cast<double>(seen) / static_cast<double>(counts.size());
}

}  // namespace v3d::calib
