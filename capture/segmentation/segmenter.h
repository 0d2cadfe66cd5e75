// Segmentation of one image.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/image/image.h"
#include "base/image/mask.h"
#include "base/image/mask_operations.h"
#include "capture/segmentation/background.h"
#include "capture/segmentation/mask_cleanup.h"

namespace v3d::segmentation {

// Suppresses foreground pieces that are displaced background, such as a carpet's edge that moved,
// or a lamp seen by a camera that sank a little.
// Source: Elgammal, Harwood, Davis: "Non-parametric Model for Background Subtraction" (ECCV 2000),
// section 4, suppression of false detections. Here it decides on whole pieces, so that a performer
// loses no pixel whose colour equals the background's.

/// The background that an image should show.
struct ExpectedBackground {
  const BackgroundTable& table;
  uint32_t gain;        ///< brightness of the image, see brightness_ratio()
  uint32_t quad_limit;  ///< squared distance above which a quad differs, see QuadTest::limit
};

/// True if at least 60 % of a foreground piece match background at most `reach` pixels away in x
/// and in y. It tests up to 64 pixels of the piece, so the time does not depend on its area. Pure
/// function.
bool is_moved_background(const MaskComponents& pieces, size_t piece, ImageView image,
                         const ExpectedBackground& background, int reach);

// Finds the quads of an image that differ from the background: inner loop of the segmentation.

/// A quad is background in another light if one factor explains all its samples: the residual of
/// each is at most `allowed` plus `allowed_part` of the quad's mean.
struct LightTest {
  /// `lowest`, `highest`: range of the factor, less than 2. `chroma`: allowed_part for one channel.
  /// `noise_floor`: grey values; `allowed` is a multiple of it.
  LightTest(float lowest, float highest, float chroma, int channels, float noise_floor);

  uint16_t min_factor;  ///< 1/32768
  uint16_t max_factor;
  uint16_t allowed;       ///< 1/64 grey value
  uint16_t allowed_part;  ///< 1/65536; divided by the number of channels
};

/// Test whether a quad (2x2 neighbouring pixels) differs. Grey values, distances and factors are
/// fixed-point numbers.
struct QuadTest {
  QuadTest(const BackgroundTable& background, const SegmentOptions& options);

  uint16_t limit;  ///< a quad differs if the sum of its samples' squared distances exceeds this
  uint16_t max_distance;  ///< distances are limited to this, so that the sum fits 16 bits
  bool ignores_shadows;   ///< false for grey images: a shadow cannot be detected without colour
  LightTest shadow;       ///< for shadows and small highlights
  LightTest key;          ///< for the colour of the chroma key, in any light
};

/// Finds differing quads. Keeps its working memory between calls. Not thread-safe.
class DifferingQuads {
 public:
  explicit DifferingQuads(const BackgroundTable& background);

  /// Bit (x, y) of the result is 1 if the quad of columns x, x + 1 and rows y, y + 1 differs from
  /// the background. `gain`: brightness of the image, see brightness_ratio(). Bits of the last
  /// column are 1; those of the last row are undefined. The result is valid until the next call.
  /// Requires an image of the background's size and format, at least 2x2 pixels.
  /// Vectorised for the processor at run time; every processor gives the same bits.
  const Mask& find(ImageView image, const BackgroundTable& background, const QuadTest& test,
                   uint32_t gain);

 private:
  Mask quads_;
  std::vector<uint16_t> evidence_;  ///< per pixel of the last row: squared distance
  std::vector<uint16_t> columns_;   ///< per column: sum over the last two rows
  /// Copies of the last rows, where vector loads would read beyond the image.
  std::vector<uint8_t> tails_[2];
};

// Background subtraction: raw image (Bayer, mono or RGB) to silhouette.

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
  void restore_plates();

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

}  // namespace v3d::segmentation
