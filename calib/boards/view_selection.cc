#include "calib/boards/view_selection.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace v3d::calib {
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
