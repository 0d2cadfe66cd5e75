// Cleanup of a segmented mask: smoothing, removal of small pieces and holes, repair of outlines.
#pragma once

#include <cstddef>

#include "base/image/mask.h"
#include "base/image/mask_components.h"
#include "capture/segmentation/mask_holes.h"
#include "capture/segmentation/mask_majority.h"
#include "capture/segmentation/outline_repair.h"
#include "capture/segmentation/segment_options.h"

namespace v3d {

/// Smooths the mask, drops foreground pieces that are too small or unwanted, fills small holes. If
/// the outline is frayed, it fills the notches first. Keeps its working memory between masks,
/// except for frayed ones. Not thread-safe.
class MaskCleanup {
 public:
  /// `is_unwanted(pieces, i)`: true if the i-th piece is to be dropped whatever its size.
  template <class IsUnwanted>
  void clean(Mask& mask, const SegmentOptions& options, const IsUnwanted& is_unwanted) {
    raw_ = mask;
    clean_once(mask, options, is_unwanted);
    if (!is_frayed(raw_, mask)) return;
    mask = without_notches(raw_, mask);
    clean_once(mask, options, is_unwanted);
  }
  void clean(Mask& mask, const SegmentOptions& options) {
    clean(mask, options, [](const MaskComponents&, size_t) { return false; });
  }

 private:
  template <class IsUnwanted>
  void clean_once(Mask& mask, const SegmentOptions& options, const IsUnwanted& is_unwanted) {
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
