// What is done to the mask that a segmenter has found.
#pragma once

#include <cstddef>

#include "base/mask.h"
#include "base/mask_pieces.h"
#include "capture/mask_holes.h"
#include "capture/mask_majority.h"
#include "capture/segment_options.h"

namespace v3d {

/// Makes it smooth, drops pieces of foreground that are too small or unwanted, fills small holes.
/// Keeps its working memory between masks. One thread.
class MaskCleanup {
 public:
  /// `is_unwanted(pieces, i)`: whether the i-th piece goes whatever its size.
  template <class IsUnwanted>
  void clean(Mask& mask, const SegmentOptions& options, const IsUnwanted& is_unwanted) {
    take_majority(mask);
    pieces_.find(mask);
    for (size_t i = 0; i < pieces_.count(); ++i) {
      if (pieces_.area(i) < options.min_area || is_unwanted(pieces_, i)) pieces_.drop(i, mask);
    }
    holes_.fill_small(mask, pieces_.runs(), options.max_hole);
  }
  void clean(Mask& mask, const SegmentOptions& options) {
    clean(mask, options, [](const MaskPieces&, size_t) { return false; });
  }

 private:
  MaskPieces pieces_;
  MaskHoles holes_;
};

}  // namespace v3d
