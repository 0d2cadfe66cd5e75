// A silhouette in all its coarser versions, to ask what a rectangle of pixels holds.
#pragma once

#include <cstdint>
#include <vector>

#include "base/mask.h"

namespace v3d {

enum class Coverage {
  kNone,  ///< all background
  kSome,  ///< mixed, or not known
  kAll,   ///< all foreground
};

/// Cells of level n are squares of 2^n pixels; each has a bit `any` (some pixel is foreground) and
/// a bit `all` (every pixel that exists is). Level 0 is the mask itself. Rows are padded to 32-bit
/// words, cell x is bit x % 32 of word x / 32. One writer; reading is safe from any thread.
class MaskPyramid {
 public:
  MaskPyramid() = default;
  explicit MaskPyramid(ImageSize size);

  /// Takes over a mask of size(); the work is proportional to its bounding box. Allocates nothing.
  void build(const Mask& mask);

  ImageSize size() const { return levels_.empty() ? ImageSize{} : levels_.front().size; }

  /// What pixels x0..x1, y0..y1, all inclusive and inside the image, hold. Never wrong with kNone
  /// and kAll; exact for rectangles of up to 32 x 32 pixels; larger ones may get kSome where the
  /// truth differs only within one cell (a 32nd of the rectangle) outside its border.
  Coverage coverage(int x0, int y0, int x1, int y1) const;

  /// Level 0 for readers of single pixels.
  const uint32_t* pixels() const { return levels_.front().any.data(); }
  int words_per_row() const { return levels_.front().words_per_row; }

 private:
  struct Level {
    ImageSize size;  ///< in cells
    int words_per_row = 0;
    std::vector<uint32_t> any;
    std::vector<uint32_t> all;  ///< empty at level 0, where it equals `any`
  };

  void copy(const Mask& mask);
  /// Fills the cells of `level` that touch `box` (pixels) from the level below.
  void halve(int level, const Rect& box);

  std::vector<Level> levels_;
  Rect filled_;  ///< pixels outside are 0 on every level
};

}  // namespace v3d
