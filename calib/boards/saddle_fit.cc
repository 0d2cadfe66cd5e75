#include "calib/boards/saddle_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace v3d::calib {
namespace {

constexpr float kMaxShift = 0.15F;  // of the spacing of the corners
// Pixels.
constexpr float kMinSmoothing = 0.7F;
constexpr float kMinWeights = 1;
constexpr double kRest = 1e-4;
constexpr double kMaxStep = 1;

constexpr float kRadius = 1.5F;  // of the pixels that count, by the deviation of the weights
constexpr int kMaxSteps = 15;

/// The smoothed grey values around a point.
struct Neighbourhood {
  cv::Mat grey;      ///< CV_32F
  cv::Point origin;  ///< pixel of its upper left corner in the image
  float sigma = 1;   ///< of the weights
  float radius = 1;
};

/// Requires a point in the image.
Neighbourhood neighbourhood(const cv::Mat& grey, const cv::Point2f& point, float spacing,
                            const SaddleFit& fit) {
  const float smoothing = std::max(kMinSmoothing, fit.smoothing * spacing);
  Neighbourhood near{
      .grey = {}, .origin = {}, .sigma = std::max(kMinWeights, fit.weights * spacing)};
  near.radius = kRadius * near.sigma;
  const int half = cvCeil(near.radius + kMaxShift * spacing + 3 * smoothing) + 1;
  const cv::Rect whole(cvRound(point.x) - half, cvRound(point.y) - half, 2 * half + 1,
                       2 * half + 1);
  const cv::Rect box = whole & cv::Rect({0, 0}, grey.size());
  cv::Mat values;
  grey(box).convertTo(values, CV_32F);
  cv::GaussianBlur(values, near.grey, {}, smoothing);
  near.origin = box.tl();
  return near;
}

/// From `point` to the saddle of the quadratic function that fits best there; empty without one.
std::optional<Eigen::Vector2d> step_to_saddle(const Neighbourhood& near, const cv::Point2f& point) {
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Vector<double, 6> right = Eigen::Vector<double, 6>::Zero();
  const cv::Point2f centre = point - cv::Point2f(near.origin);
  const int x0 = cvFloor(centre.x - near.radius), x1 = cvCeil(centre.x + near.radius);
  const int y0 = cvFloor(centre.y - near.radius), y1 = cvCeil(centre.y + near.radius);
  for (int y = std::max(0, y0); y <= std::min(near.grey.rows - 1, y1); ++y) {
    for (int x = std::max(0, x0); x <= std::min(near.grey.cols - 1, x1); ++x) {
      const double dx = x - centre.x, dy = y - centre.y;
      const double square = dx * dx + dy * dy;
      if (square > near.radius * near.radius) continue;
      const double weight = std::exp(-square / (2 * near.sigma * near.sigma));
      const Eigen::Vector<double, 6> row{1, dx, dy, dx * dx / 2, dx * dy, dy * dy / 2};
      normal += weight * row * row.transpose();
      right += weight * near.grey.at<float>(y, x) * row;
    }
  }
  const Eigen::Vector<double, 6> surface = normal.ldlt().solve(right);
  Eigen::Matrix2d hessian;
  hessian << surface[3], surface[4], surface[4], surface[5];
  if (hessian.determinant() >= 0) return std::nullopt;
  return -hessian.inverse() * surface.segment<2>(1);
}

/// The saddle near a point; empty where there is none.
std::optional<cv::Point2f> saddle_near(const cv::Mat& grey, const cv::Point2f& point, float spacing,
                                       const SaddleFit& fit) {
  const Neighbourhood near = neighbourhood(grey, point, spacing, fit);
  cv::Point2f saddle = point;
  for (int i = 0; i < kMaxSteps; ++i) {
    auto step = step_to_saddle(near, saddle);
    if (!step) return std::nullopt;
    const double length = step->norm();
    if (length > kMaxStep) *step *= kMaxStep / length;
    saddle += cv::Point2f(static_cast<float>(step->x()), static_cast<float>(step->y()));
    if (cv::norm(saddle - point) > kMaxShift * spacing) return std::nullopt;
    if (length < kRest) break;
  }
  return saddle;
}

}  // namespace

void refine_saddles(const cv::Mat& grey, std::span<const float> spacings, const SaddleFit& fit,
                    std::vector<cv::Point2f>& points) {
  for (size_t i = 0; i < points.size(); ++i) {
    if (const auto saddle = saddle_near(grey, points[i], spacings[i], fit)) points[i] = *saddle;
  }
}

}  // namespace v3d::calib
