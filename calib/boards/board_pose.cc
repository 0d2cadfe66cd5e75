#include "calib/boards/board_pose.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

namespace v3d::calib {
namespace {

/// Corners and, after the lens is taken out, where they were seen (normalised, x/z and y/z).
struct FlatPoints {
  std::vector<cv::Point3d> board;
  std::vector<cv::Point2d> seen;
};

FlatPoints flat_points(const CameraModel& camera, const Board& board,
                       const BoardSighting& sighting) {
  FlatPoints points;
  const Eigen::Matrix3d& cam_from_world = camera.cam_from_world().rotation;
  for (int i = 0; i < sighting.count(); ++i) {
    const auto in_world = camera.ray(sighting.pixels[i]);
    if (!in_world) continue;
    const Eigen::Vector3d ray = cam_from_world * *in_world;
    // Round the board's centre: the planar solver wants it so.
    const Eigen::Vector3d corner = board.corner(sighting.corners[i]) - board.centre();
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

CameraModel placed(const CameraModel& lens, const RigidTransform& cam_from_world) {
  return {lens.size(), lens.matrix(), lens.distortion(), cam_from_world};
}

double rms_of(std::span<const Eigen::Vector2d> misses) {
  double sum = 0;
  for (const Eigen::Vector2d& miss : misses) sum += miss.squaredNorm();
  return misses.empty() ? 0 : std::sqrt(sum / static_cast<double>(misses.size()));
}

std::vector<Eigen::Vector2d> misses(const CameraModel& camera, const Board& board,
                                    const RigidTransform& cam_from_board,
                                    const BoardSighting& sighting) {
  // Another camera would have to find the reach of its lens again, which takes longer than all
  // this.
  const RigidTransform world_from_board = camera.cam_from_world().inverse() * cam_from_board;
  std::vector<Eigen::Vector2d> result;
  for (int i = 0; i < sighting.count(); ++i) {
    const auto pixel = camera.project(world_from_board * board.corner(sighting.corners[i]));
    result.push_back(pixel ? Eigen::Vector2d(sighting.pixels[i] - *pixel)
                           : Eigen::Vector2d(1e6, 1e6));
  }
  return result;
}

std::vector<BoardPose> board_poses(const CameraModel& camera, const Board& board,
                                   const BoardSighting& sighting) {
  const FlatPoints points = flat_points(camera, board, sighting);
  if (points.board.size() < 4) return {};
  std::vector<cv::Mat> rotations, translations;
  const cv::Matx33d identity = cv::Matx33d::eye();
  try {
    cv::solvePnPGeneric(points.board, points.seen, identity, cv::noArray(), rotations, translations,
                        false, cv::SOLVEPNP_IPPE);
  } catch (const cv::Exception&) {
    return {};  // corners on a line
  }
  std::vector<BoardPose> poses;
  for (size_t i = 0; i < rotations.size(); ++i) {
    const RigidTransform pose = to_transform(rotations[i], translations[i]) *
                                RigidTransform{Eigen::Matrix3d::Identity(), -board.centre()};
    // A board seen from behind, or behind the camera, is no board that was seen.
    const bool in_front = (pose * board.centre()).z() > 0;
    if (!in_front) continue;
    poses.push_back({pose, rms_of(misses(camera, board, pose, sighting))});
  }
  std::sort(poses.begin(), poses.end(),
            [](const BoardPose& a, const BoardPose& b) { return a.rms_px < b.rms_px; });
  return poses;
}

Eigen::Matrix3d first_camera_matrix(const Board& board, ImageSize size,
                                    std::span<const BoardSighting* const> sightings) {
  std::vector<std::vector<cv::Point3f>> corners;
  std::vector<std::vector<cv::Point2f>> pixels;
  for (const BoardSighting* sighting : sightings) {
    auto& view_corners = corners.emplace_back();
    auto& view_pixels = pixels.emplace_back();
    for (int i = 0; i < sighting->count(); ++i) {
      const Eigen::Vector3d c = board.corner(sighting->corners[i]);
      view_corners.emplace_back(static_cast<float>(c.x()), static_cast<float>(c.y()), 0.F);
      view_pixels.emplace_back(static_cast<float>(sighting->pixels[i].x()),
                               static_cast<float>(sighting->pixels[i].y()));
    }
  }
  const cv::Mat k = cv::initCameraMatrix2D(corners, pixels, {size.width, size.height}, 1.0);
  const double widest = std::max(size.width, size.height);
  double focal = k.at<double>(0, 0);
  // Frontal views say nothing of the focal length: then something an ordinary lens has.
  if (!std::isfinite(focal) || focal < 0.2 * widest || focal > 20 * widest) focal = widest;
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  matrix(0, 0) = matrix(1, 1) = focal;
  matrix(0, 2) = 0.5 * (size.width - 1);
  matrix(1, 2) = 0.5 * (size.height - 1);
  return matrix;
}

}  // namespace v3d::calib
