// What is done to the mask that a segmenter has found.
#pragma once

#include <cstddef>

#include "base/image/mask.h"
#include "base/image/mask_components.h"
#include "capture/segmentation/frayed_outline.h"
#include "capture/segmentation/mask_holes.h"
#include "capture/segmentation/mask_majority.h"
#include "capture/segmentation/segment_options.h"

namespace v3d {

/// Makes it smooth, drops pieces of foreground that are too small or unwanted, fills small holes.
/// Where the outline turns out to be frayed, its notches are filled first. Keeps its working memory
/// between masks, but for frayed ones. One thread.
class MaskCleanup {
 public:
  /// `is_unwanted(pieces, i)`: whether the i-th piece goes whatever its size.
  template <class IsUnwanted>
  void clean(Mask& mask, const SegmentOptions& options, const IsUnwanted& is_unwanted) {
    raw_ = mask;
    smoothen(mask, options, is_unwanted);
    if (!is_frayed(raw_, mask)) return;
    mask = without_notches(raw_, mask);
    smoothen(mask, options, is_unwanted);
  }
  void clean(Mask& mask, const SegmentOptions& options) {
    clean(mask, options, [](const MaskComponents&, size_t) { return false; });
  }

 private:
  template <class IsUnwanted>
  void smoothen(Mask& mask, const SegmentOptions& options, const IsUnwanted& is_unwanted) {
    take_majority(mask);
    pieces_.find(mask);
    for (size_t i = 0; i < pieces_.count(); ++i) {
      if (pieces_.area(i) < options.min_area || is_unwanted(pieces_, i)) pieces_.drop(i, mask);
    }
    holes_.fill_small(mask, pieces_.runs(), options.max_hole);
  }

  Mask raw_;
  MaskComponents pieces_;
  MaskHoles holes_;
};

}  // namespace v3d
