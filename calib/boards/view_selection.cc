#include "calib/boards/view_selection.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace v3d::calib {
namespace {

/// Place in the image (2), distance (1), leaning (2): about 0 to 1 each.
using Looks = Eigen::Matrix<double, 5, 1>;
constexpr double kNearCopy = 0.015;

/// The best affine map from the board to the image: how the board looks, whatever the lens.
Looks looks_of(const Board& board, ImageSize size, const BoardSighting& sighting) {
  const int n = sighting.count();
  Eigen::MatrixXd from(n, 3), to(n, 2);
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d corner = board.corner(sighting.corners[i]) / board.square_m;
    from.row(i) << corner.x(), corner.y(), 1;
    to.row(i) = sighting.pixels[i].transpose();
  }
  const Eigen::MatrixXd map = from.colPivHouseholderQr().solve(to);
  const Eigen::Matrix2d a = map.topRows<2>().transpose();
  const double area = std::max(std::abs(a.determinant()), 1e-6);
  const Eigen::Matrix2d stretch = a * a.transpose() / area;
  const Eigen::Vector2d middle = to.colwise().mean().transpose();
  Looks looks;
  looks << middle.x() / size.width, middle.y() / size.height, 0.25 * std::log(area),
      0.25 * (stretch(0, 0) - stretch(1, 1)), 0.5 * stretch(0, 1);
  return looks;
}

}  // namespace

std::vector<int> choose_views(const Board& board, ImageSize size,
                              std::span<const BoardSighting* const> sightings, int most) {
  std::vector<Looks> looks;
  for (const BoardSighting* s : sightings) looks.push_back(looks_of(board, size, *s));
  const auto fullest = std::max_element(sightings.begin(), sightings.end(),
                                        [](auto* a, auto* b) { return a->count() < b->count(); });
  std::vector<int> chosen;
  std::vector<double> distance(sightings.size(), std::numeric_limits<double>::infinity());
  auto next = static_cast<size_t>(fullest - sightings.begin());
  while (std::ssize(chosen) < most && next < sightings.size() && distance[next] > kNearCopy) {
    chosen.push_back(static_cast<int>(next));
    for (size_t i = 0; i < looks.size(); ++i) {
      distance[i] = std::min(distance[i], (looks[i] - looks[next]).norm());
    }
    next =
        static_cast<size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

std::vector<int> coverage_counts(ImageSize size, std::span<const BoardSighting* const> sightings) {
  std::vector<int> counts(kCoverageColumns * kCoverageRows);
  for (const BoardSighting* sighting : sightings) {
    for (const Eigen::Vector2d& pixel : sighting->pixels) {
      const int x = static_cast<int>((pixel.x() + 0.5) / size.width * kCoverageColumns);
      const int y = static_cast<int>((pixel.y() + 0.5) / size.height * kCoverageRows);
      ++counts[std::clamp(y, 0, kCoverageRows - 1) * kCoverageColumns +
               std::clamp(x, 0, kCoverageColumns - 1)];
    }
  }
  return counts;
}

double coverage(ImageSize size, std::span<const BoardSighting* const> sightings) {
  const std::vector<int> counts = coverage_counts(size, sightings);
  const auto seen = std::count_if(counts.begin(), counts.end(), [](int n) { return n > 0; });
  return static_cast<double>(seen) / static_cast<double>(counts.size());
}

}  // namespace v3d::calib
