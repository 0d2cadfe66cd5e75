// OpenCV's background subtractors MOG2 and KNN with our image types.
#pragma once

#include <memory>
#include <vector>

#include "base/image/image.h"

namespace v3d::bench {

struct SubtractorOptions {
  enum class Method { kMog2, kKnn };
  Method method = Method::kMog2;
  double threshold = 16;  ///< varThreshold of MOG2, dist2Threshold of KNN
  bool shadows = true;    ///< mark detected shadows as 127
};

/// Background subtractor of one camera. It learns from plates, then segments images without
/// learning. One caller at a time; OpenCV runs in the caller's TBB arena.
class OpencvSubtractor {
 public:
  explicit OpencvSubtractor(const SubtractorOptions& options);
  ~OpencvSubtractor();
  OpencvSubtractor(OpencvSubtractor&&) noexcept;

  /// Replaces the model. Learns the plates `rounds` times, with OpenCV's automatic learning rate
  /// for a short history. Requires 2 plates or more of one size and format. A Bayer image is used
  /// as a grey image, because the model treats every pixel separately.
  void learn(const std::vector<ImageView>& plates, int rounds = 1);

  /// 0 background, 127 shadow, 255 foreground: Mono8, valid until the next call.
  ImageView segment(ImageView image);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Opens, then closes foreground (Mono8, 0 or 255) by ellipses of the given diameters in pixels; 0
/// omits a step. This is the usual clean-up after a subtractor.
Image open_and_close(const Image& foreground, int open_px, int close_px);

}  // namespace v3d::bench
