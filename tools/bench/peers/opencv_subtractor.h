// OpenCV's background subtraction (module video) behind our types.
#pragma once

#include <memory>
#include <vector>

#include "base/image/image.h"

namespace v3d::bench {

struct SubtractorOptions {
  enum class Method { kMog2, kKnn };
  Method method = Method::kMog2;
  double threshold = 16;  ///< varThreshold of MOG2, dist2Threshold of KNN
  bool shadows = true;    ///< mark what looks like a shadow as 127
};

/// One camera. Learns from plates, then judges images without learning from them. One caller at a
/// time; OpenCV spreads an image over the caller's TBB arena.
class OpencvSubtractor {
 public:
  explicit OpencvSubtractor(const SubtractorOptions& options);
  ~OpencvSubtractor();
  OpencvSubtractor(OpencvSubtractor&&) noexcept;

  /// Replaces the model. Shows the plates `rounds` times over, each time with OpenCV's own choice
  /// of the learning rate for so short a history. Requires 2 plates or more, of one size and
  /// format; a Bayer image is taken as grey, which is what it is to a model of single pixels.
  void learn(const std::vector<ImageView>& plates, int rounds = 1);

  /// 0 background, 127 shadow, 255 foreground: Mono8, valid until the next call.
  ImageView segment(ImageView image);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Foreground (Mono8, 0 or 255) opened, then closed, by ellipses of so many pixels; 0 leaves a step
/// out. The usual clean-up after a subtractor.
Image open_and_close(const Image& foreground, int open_px, int close_px);

}  // namespace v3d::bench
