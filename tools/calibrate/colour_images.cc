#include "calibrate/colour_images.h"

#include <algorithm>
#include <array>
#include <optional>

#include "base/core/error.h"
#include "base/image/demosaic.h"
#include "calib/colour/chart_detector.h"
#include "v3dctl/process.h"

namespace v3d::calibrate {
namespace {

using calib::ColourSample;
using Eigen::Vector3d;

constexpr int kMaxImages = 20;  // of each camera

int camera_of(const NamedSource& source, const std::vector<std::string>& names) {
  const auto found = std::ranges::find(names, source.camera);
  if (found == names.end()) {
    throw InputError(source.camera + ": no such camera in the calibration, which has " +
                     join_names(names));
  }
  return static_cast<int>(found - names.begin());
}

/// The mean of the middle ninth of an image.
Vector3d middle_colour(ImageView image) {
  const Image rgb = to_rgb(image);
  const int x0 = rgb.size.width / 3, y0 = rgb.size.height / 3;
  Vector3d sum = Vector3d::Zero();
  int64_t count = 0;
  for (int y = y0; y < rgb.size.height - y0; ++y) {
    const uint8_t* row = rgb.row(y);
    for (int x = x0; x < rgb.size.width - x0; ++x, ++count) {
      sum += Vector3d(row[3 * x], row[3 * x + 1], row[3 * x + 2]);
    }
  }
  return sum / static_cast<double>(std::max<int64_t>(1, count));
}

/// The mean of several observations of the chart by one camera.
class ChartMean {
 public:
  void add(const calib::ChartColours& colours) {
    for (size_t i = 0; i < colours.size(); ++i) {
      if (!calib::is_well_exposed(colours[i])) continue;
      sums_[i] += colours[i];
      ++counts_[i];
    }
    ++charts_;
  }
  int charts() const { return charts_; }
  void put(int camera, std::vector<ColourSample>& samples) const {
    for (size_t i = 0; i < sums_.size(); ++i) {
      if (counts_[i] > 0) samples.push_back({static_cast<int>(i), camera, sums_[i] / counts_[i]});
    }
  }

 private:
  std::array<Vector3d, 24> sums_ = [] {
    std::array<Vector3d, 24> zeros;
    zeros.fill(Vector3d::Zero());
    return zeros;
  }();
  std::array<int, 24> counts_{};
  int charts_ = 0;
};

}  // namespace

std::vector<ColourSample> find_charts(std::vector<NamedSource> sources,
                                      const std::vector<std::string>& names) {
  std::vector<ColourSample> samples;
  for (NamedSource& source : sources) {
    const int camera = camera_of(source, names);
    ChartMean mean;
    while (mean.charts() < kMaxImages) {
      ctl::stop_if_interrupted();
      const auto image = source.source.next();
      if (!image) break;
      if (const auto chart = calib::find_chart(image->pixels.view())) mean.add(*chart);
    }
    if (mean.charts() == 0) {
      throw InputError(source.source.name + ": no colour chart with 24 patches found; show it to " +
                       source.camera + " completely and frontally, at least 150 pixels wide");
    }
    mean.put(camera, samples);
  }
  return samples;
}

std::vector<ColourSample> find_grey(std::vector<NamedSource> sources,
                                    const std::vector<std::string>& names) {
  std::vector<ColourSample> samples;
  for (NamedSource& source : sources) {
    const int camera = camera_of(source, names);
    for (int i = 0; i < kMaxImages; ++i) {
      const auto image = source.source.next();
      if (!image) break;
      const Vector3d grey = middle_colour(image->pixels.view());
      if (calib::is_well_exposed(grey)) samples.push_back({0, camera, grey});
    }
  }
  return samples;
}

std::vector<Vector3d> find_black(std::vector<NamedSource> sources,
                                 const std::vector<std::string>& names) {
  std::vector<std::optional<Vector3d>> black(names.size());
  for (NamedSource& source : sources) {
    const int camera = camera_of(source, names);
    Vector3d sum = Vector3d::Zero();
    int count = 0;
    for (; count < kMaxImages; ++count) {
      const auto image = source.source.next();
      if (!image) break;
      sum += middle_colour(image->pixels.view());
    }
    black[camera] = sum / std::max(1, count);
  }
  std::vector<Vector3d> result;
  for (size_t c = 0; c < names.size(); ++c) {
    if (!black[c]) throw InputError("--dark: no image of " + names[c]);
    result.push_back(*black[c]);
  }
  return result;
}

}  // namespace v3d::calibrate
