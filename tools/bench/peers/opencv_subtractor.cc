#include "peers/opencv_subtractor.h"

#include <opencv2/imgproc.hpp>
#include <opencv2/video/background_segm.hpp>

namespace v3d::bench {
namespace {

/// Learning rate that changes nothing. MOG2 accepts 0; KNN divides by the logarithm of 1 - rate, so
/// 0 would replace the model by every image.
double no_learning(SubtractorOptions::Method method) {
  return method == SubtractorOptions::Method::kMog2 ? 0.0 : 1e-6;
}

cv::Ptr<cv::BackgroundSubtractor> make(const SubtractorOptions& options, int history) {
  if (options.method == SubtractorOptions::Method::kMog2) {
    return cv::createBackgroundSubtractorMOG2(history, options.threshold, options.shadows);
  }
  return cv::createBackgroundSubtractorKNN(history, options.threshold, options.shadows);
}

/// OpenCV has no view of constant bytes; apply() does not write to its input.
cv::Mat borrowed(ImageView image) {
  const int type = bytes_per_pixel(image.format) == 3 ? CV_8UC3 : CV_8UC1;
  return {image.size.height, image.size.width, type, const_cast<uint8_t*>(image.bytes.data())};
}

}  // namespace

struct OpencvSubtractor::Impl {
  SubtractorOptions options;
  cv::Ptr<cv::BackgroundSubtractor> subtractor;
  cv::Mat foreground;
};

OpencvSubtractor::OpencvSubtractor(const SubtractorOptions& options)
    : impl_(std::make_unique<Impl>()) {
  impl_->options = options;
}
OpencvSubtractor::~OpencvSubtractor() = default;
OpencvSubtractor::OpencvSubtractor(OpencvSubtractor&&) noexcept = default;

void OpencvSubtractor::learn(const std::vector<ImageView>& plates, int rounds) {
  impl_->subtractor = make(impl_->options, static_cast<int>(plates.size()) * rounds);
  for (int round = 0; round < rounds; ++round) {
    for (const ImageView& plate : plates) {
      impl_->subtractor->apply(borrowed(plate), impl_->foreground);
    }
  }
  // After learning, KNN's counters are due for an update: it learns one more image.
  segment(plates.back());
}

ImageView OpencvSubtractor::segment(ImageView image) {
  cv::Mat& foreground = impl_->foreground;
  impl_->subtractor->apply(borrowed(image), foreground, no_learning(impl_->options.method));
  return {image.size, PixelFormat::kMono8, {foreground.data, foreground.total()}};
}

Image open_and_close(const Image& foreground, int open_px, int close_px) {
  Image cleaned = foreground;
  const cv::Mat pixels(cleaned.size.height, cleaned.size.width, CV_8UC1, cleaned.bytes.data());
  const auto step = [&](int operation, int diameter) {
    if (diameter == 0) return;
    const cv::Size size(diameter, diameter);
    cv::morphologyEx(pixels, pixels, operation, cv::getStructuringElement(cv::MORPH_ELLIPSE, size));
  };
  step(cv::MORPH_OPEN, open_px);
  step(cv::MORPH_CLOSE, close_px);
  return cleaned;
}

}  // namespace v3d::bench
