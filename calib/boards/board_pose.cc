#include "calib/boards/board_pose.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

namespace v3d::calib {
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

}  // namespace v3d::calib
