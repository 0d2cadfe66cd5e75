#include "capture/segmentation/motion_stops.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <utility>

#include "base/core/statistics.h"

namespace v3d::segmentation {
namespace {

constexpr int kNoise = 16;
constexpr double kMinRatio = 5;
constexpr double kStillShare = 0.25;  // of the pictures; the others may show motion
constexpr double kMinChange = 0.02;   // of 255: one byte of 800 that exceeds the noise
constexpr double kSearchSeconds = 0.5;
constexpr double kApartSeconds = 0.1;

/// The change that ends with change k: the motion is over two pictures later. Requires k + 2 <
/// changes.size().
double drop_at(std::span<const double> changes, size_t k) { return changes[k] - changes[k + 2]; }

/// Whether no drop within `range` of that at k is greater, and no earlier one equal.
bool is_greatest(std::span<const double> changes, size_t k, size_t range) {
  const double drop = drop_at(changes, k);
  const size_t end = std::min(changes.size() - 2, k + range + 1);
  for (size_t i = k > range ? k - range : 1; i < end; ++i) {
    const double other = drop_at(changes, i);
    if (other > drop || (other == drop && i < k)) return false;
  }
  return true;
}

/// The change of the stillest quarter of the pictures within `range` of k.
double still_change(std::span<const double> changes, size_t k, size_t range) {
  const size_t begin = k > range ? k - range : 1;
  const size_t end = std::min(changes.size(), k + range + 1);
  const auto window = changes.subspan(begin, end - begin);
  std::vector<double> values(window.begin(), window.end());
  return percentile(std::move(values), kStillShare);
}

}  // namespace

double image_change(ImageView a, ImageView b) {
  const auto bytes =
      static_cast<size_t>(a.size.width) * static_cast<size_t>(bytes_per_pixel(a.format));
  int64_t sum = 0;
  for (int y = 0; y < a.size.height; ++y) {
    const uint8_t *const row_a = a.row(y), *const row_b = b.row(y);
    int32_t of_row = 0;
    for (size_t x = 0; x < bytes; ++x) {
      const int difference = std::abs(row_a[x] - row_b[x]);
      of_row += difference > kNoise ? difference : 0;
    }
    sum += of_row;
  }
  const double count = static_cast<double>(bytes) * a.size.height;
  return count > 0 ? static_cast<double>(sum) / count : 0;
}

std::vector<MotionStop> stops_of_motion(std::span<const double> changes, double rate_hz) {
  const auto search = static_cast<size_t>(std::ceil(kSearchSeconds * rate_hz));
  const auto apart = static_cast<size_t>(std::ceil(kApartSeconds * rate_hz));
  std::vector<MotionStop> stops;
  for (size_t k = 1; k + 2 < changes.size(); ++k) {
    const double drop = drop_at(changes, k);
    if (drop < kMinRatio * kMinChange || drop < changes[k] / 2) continue;
    if (!is_greatest(changes, k, apart)) continue;
    if (drop < kMinRatio * still_change(changes, k, search)) continue;
    const double part = std::clamp((changes[k + 1] - changes[k + 2]) / drop, 0.0, 1.0);
    stops.push_back({.pulse = static_cast<double>(k) + part, .change = drop});
  }
  return stops;
}

void MotionSeries::add(int64_t pulse, ImageView picture) {
  const int64_t next =
      runs_.empty() ? pulse : runs_.back().first + std::ssize(runs_.back().changes);
  if (pulse < next) return;
  const bool continues = !runs_.empty() && pulse == next && picture.size == last_.size &&
                         picture.format == last_.format;
  if (continues) {
    runs_.back().changes.push_back(image_change(last_.view(), picture));
  } else {
    runs_.push_back({.first = pulse, .changes = {0}});
  }
  last_.size = picture.size;
  last_.format = picture.format;
  last_.bytes.assign(picture.bytes.begin(), picture.bytes.end());
}

std::vector<MotionStop> MotionSeries::stops(double rate_hz) const {
  std::vector<MotionStop> stops;
  for (const Run& run : runs_) {
    for (MotionStop stop : stops_of_motion(run.changes, rate_hz)) {
      stop.pulse += static_cast<double>(run.first);
      stops.push_back(stop);
    }
  }
  if (stops.size() > kMaxStops) {
    std::ranges::nth_element(stops, stops.begin() + kMaxStops, std::greater(), &MotionStop::change);
    stops.resize(kMaxStops);
    std::ranges::sort(stops, {}, &MotionStop::pulse);
  }
  return stops;
}

std::optional<MotionStop> stop_near(std::span<const MotionStop> stops, double pulse,
                                    double rate_hz) {
  std::optional<MotionStop> greatest;
  for (const MotionStop& stop : stops) {
    if (std::abs(stop.pulse - pulse) > kSearchSeconds * rate_hz) continue;
    if (!greatest || stop.change > greatest->change) greatest = stop;
  }
  return greatest;
}

}  // namespace v3d::segmentation
