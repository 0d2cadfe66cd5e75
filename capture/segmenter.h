// Segmentation: raw image (Bayer, mono or RGB) to silhouette.
#pragma once

#include <cstdint>

#include "base/image.h"
#include "base/mask.h"
#include "capture/background.h"
#include "capture/background_table.h"
#include "capture/differing_quads.h"
#include "capture/mask_holes.h"
#include "capture/mask_pieces.h"
#include "capture/segment_options.h"

namespace v3d {

/// Pure and deterministic; keeps its working memory between calls (no allocation in steady state
/// but the mask). One thread per segmenter.
///
/// Evidence is joint: what counts is a quad, two by two neighbouring pixels, which in a Bayer image
/// holds every colour. A quad differs when the sum of its squared distances from the mean, in
/// spreads, is as improbable as one sample `threshold` spreads away. A pixel is foreground when all
/// quads it belongs to differ, which leaves straight edges and single-pixel lines where they are.
/// A quad whose samples all kept the same part of their brightness is a shadow (or a small
/// highlight) and does not differ; grey images have no colour to tell a shadow by, so there a
/// shadow is foreground. The image's brightness as a whole is brought to that of the model first.
/// Pieces of foreground that are background which moved a little (is_moved_background()) go.
class Segmenter {
 public:
  Segmenter(const BackgroundModel& model, const SegmentOptions& options);
  /// Requires: image of the model's size and format.
  Mask segment(ImageView image);

  ImageSize size() const { return table_.size; }
  PixelFormat format() const { return table_.format; }

 private:
  void drop_pieces(Mask& mask, ImageView image, uint32_t gain);

  SegmentOptions options_;
  BackgroundTable table_;
  QuadTest quad_test_;
  DifferingQuads quads_;
  MaskPieces pieces_;
  MaskHoles holes_;
};

}  // namespace v3d
