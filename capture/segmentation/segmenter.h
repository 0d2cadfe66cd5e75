// Segmentation: raw image (Bayer, mono or RGB) to silhouette.
#pragma once

#include <cstdint>

#include "base/image/image.h"
#include "base/image/mask.h"
#include "capture/segmentation/background.h"
#include "capture/segmentation/background_adaptation.h"
#include "capture/segmentation/background_table.h"
#include "capture/segmentation/differing_quads.h"
#include "capture/segmentation/mask_cleanup.h"
#include "capture/segmentation/segment_options.h"

namespace v3d {

/// Deterministic; keeps its working memory between calls (no allocation in steady state
/// but the mask). One thread per segmenter.
///
/// Evidence is joint: what counts is a quad, two by two neighbouring pixels, which in a Bayer image
/// holds every colour. A quad differs when the sum of its squared distances from the mean, in
/// spreads, is as improbable as one sample `threshold` spreads away. A pixel is foreground when all
/// quads it belongs to differ, which leaves straight edges and single-pixel lines where they are.
/// A quad whose samples all kept the same part of their brightness is a shadow (or a small
/// highlight) and does not differ; grey images have no colour to tell a shadow by, so there a
/// shadow is foreground. Where the background has the colour of its chroma key, a quad of that
/// colour in any light does not differ: neither folds and dark corners of the cloth nor light that
/// changes do, and what stands before it keeps its own colour, also where the cloth shines upon it.
/// The image's brightness as a whole is brought to that of the model first. Pieces of foreground
/// that are background which moved a little (is_moved_background()) go.
///
/// The background follows the light slowly (BackgroundAdaptation), from every 32nd pulse of a take,
/// and so that a mask can be made again from the recorded take: it depends on the plates, the image
/// and the frames that stand before it in the camera's log, on nothing else. The rule: who segments
/// asks for every frame that is in the log, in the order of the log, whether the segmenter
/// learns_from() its pulse, and if so has it segmented and learnt, whatever else becomes of it.
class Segmenter {
 public:
  Segmenter(const BackgroundModel& model, const SegmentOptions& options);
  /// Requires: image of the model's size and format.
  Mask segment(ImageView image);

  /// Pulses that have no place behind the last one that was learnt are never learnt.
  bool learns_from(int64_t pulse) const { return pulse % kLearnEvery == 0 && pulse > learnt_; }
  /// Requires: learns_from(pulse), and mask is what segment() has just made of this image.
  void learn(int64_t pulse, ImageView image, const Mask& mask);
  /// Starts again from the plates.
  void forget();

  ImageSize size() const { return table_.size; }
  PixelFormat format() const { return table_.format; }

 private:
  static constexpr int64_t kLearnEvery = 32;  ///< pulses: about a second

  SegmentOptions options_;
  BackgroundTable table_;
  QuadTest quad_test_;
  DifferingQuads quads_;
  MaskCleanup cleanup_;
  BackgroundAdaptation adaptation_;
  int64_t learnt_ = -1;  ///< the last pulse that was
};

}  // namespace v3d
