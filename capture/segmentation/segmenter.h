// Background subtraction: raw image (Bayer, mono or RGB) to silhouette.
#pragma once

#include <cstdint>

#include "base/image/image.h"
#include "base/image/mask.h"
#include "capture/segmentation/background.h"
#include "capture/segmentation/background_adaptation.h"
#include "capture/segmentation/background_table.h"
#include "capture/segmentation/mask_cleanup.h"
#include "capture/segmentation/quad_difference.h"
#include "capture/segmentation/segment_options.h"

namespace v3d {

/// Segments the images of one camera. Deterministic. Keeps its working memory between calls: in the
/// steady state it allocates only the mask. Not thread-safe.
///
/// Method, in this order:
///   - The brightness of the whole image is scaled to that of the model (brightness_ratio()).
///   - Quads (2x2 neighbouring pixels) are tested, because in a Bayer image they hold all colours.
///     A quad differs if the sum of its squared distances from the mean, in spreads, is as
///     improbable as one sample `threshold` spreads away.
///   - A quad whose samples all kept the same part of their brightness is a shadow or a small
///     highlight, and does not differ. Grey images have no colour, so a shadow is foreground there.
///   - Where the background has the colour of the chroma key, a quad of that colour in any light
///     does not differ. So folds, dark corners and changing light on the cloth are background. The
///     performer keeps his own colour, also where the cloth reflects on him.
///   - A pixel is foreground if all quads that contain it differ. This preserves straight edges and
///     lines one pixel wide.
///   - Foreground pieces that are displaced background are dropped (is_moved_background()).
///
/// The background model adapts slowly to the light (BackgroundAdaptation), at every 32nd pulse of a
/// take. A mask can be reproduced from the recorded take: it depends only on the plates, the image
/// and the earlier frames in the camera's log. For this, the caller must call learns_from() for
/// every frame in the log, in the log's order. If it returns true, the caller must segment and
/// learn() the frame, whatever else happens to it.
class Segmenter {
 public:
  Segmenter(const BackgroundModel& model, const SegmentOptions& options);
  /// The silhouette of the image; empty if the image is smaller than 2x2 pixels.
  /// Requires an image of the model's size and format.
  Mask segment(ImageView image);

  /// True for every 32nd pulse that is later than the last learnt one.
  bool learns_from(int64_t pulse) const { return pulse % kLearnEvery == 0 && pulse > learnt_; }
  /// Adapts the model to the image. Requires learns_from(pulse), and that `mask` is the result of
  /// the last segment() call, for this image.
  void learn(int64_t pulse, ImageView image, const Mask& mask);
  /// Restores the model of the plates.
  void forget();

  ImageSize size() const { return table_.size; }
  PixelFormat format() const { return table_.format; }

 private:
  static constexpr int64_t kLearnEvery = 32;  ///< pulses; about one second

  SegmentOptions options_;
  BackgroundTable table_;
  QuadTest quad_test_;
  DifferingQuads quads_;
  MaskCleanup cleanup_;
  BackgroundAdaptation adaptation_;
  int64_t learnt_ = -1;  ///< last learnt pulse
};

}  // namespace v3d
