#include "calib/colour/chart_detector.h"

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/mcc.hpp>

#include "base/image/demosaic.h"

namespace v3d::calib {
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
