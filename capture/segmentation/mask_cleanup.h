// Cleanup of a mask: holes, majority filter, outline repair.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/core/union_find.h"
#include "base/image/mask.h"
#include "base/image/mask_operations.h"
#include "capture/segmentation/background.h"

namespace v3d::segmentation {

// Fills small holes in the foreground of a mask.

/// Keeps its working memory between masks. Not thread-safe.
class MaskHoles {
 public:
  /// Fills 4-connected background pieces of fewer than `max_hole` pixels that do not touch the
  /// border. `runs` are the foreground runs of the mask, sorted by row, then by column. Empty runs
  /// are ignored.
  void fill_small(Mask& mask, std::span<const Run> runs, int max_hole);

 private:
  void find_gaps(std::span<const Run> runs);
  void join_touching();
  void join_rows(size_t above, size_t here, size_t end);

  /// Background between two runs of a row, and left and right of all runs. The outer gaps belong to
  /// the outside.
  std::vector<Run> gaps_;
  std::vector<int64_t> area_;
  UnionFind sets_;
};

// 3x3 majority filter of a mask.

/// Sets each pixel to the majority of its 3x3 neighbourhood. Border pixels are repeated outside the
/// mask. Lines two pixels wide are kept.
void filter_majority(Mask& mask);

// Repair of frayed outlines: random missing pixels, where performer and background look alike.

/// True if a silhouette has more than one notch per ten pixels of its outline. A notch is one or
/// two missing pixels, one pixel deep. `raw` is the mask as segmented; `smooth` is the same without
/// specks and holes and defines the outline.
///
/// Clean outlines have up to 2 notches per 100 pixels. Noise of 5 % of all pixels makes 4 to 7
/// (docs/silhouettes.md). Requires masks of equal size. Pure function.
bool is_frayed(const Mask& raw, const Mask& smooth);

/// Fills the notches in `raw` near the outline of `smooth`. A notch here is a run of up to eight
/// background pixels along a row, a column or a diagonal. It has foreground at both ends and along
/// one whole side. A gap between two limbs has foreground along one side only at its end, so it
/// stays open.
///
/// Also fills single background pixels inside, and removes bumps of one or two pixels. The result
/// contains no pixel farther than two pixels from `smooth`. Requires masks of equal size. Pure
/// function.
Mask without_notches(const Mask& raw, const Mask& smooth);

// Cleanup of a segmented mask: smoothing, removal of small pieces and holes, repair of outlines.

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
    filter_majority(mask);
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

}  // namespace v3d::segmentation
