// Mask pyramid: a silhouette at decreasing resolutions. It answers quickly whether a rectangle is
// foreground, background or mixed.
#pragma once

#include <bit>
#include <cstdint>
#include <vector>

#include "base/image/mask.h"

namespace v3d::recon {

enum class MaskCoverage {
  kNone,  ///< all background
  kSome,  ///< mixed, or not known
  kAll,   ///< all foreground
};

/// Cells of level n are squares of 2^n pixels. Each has a bit `any` (some pixel is foreground) and
/// a bit `all` (every existing pixel is). Level 0 is the mask itself. One writer; any thread may
/// read afterwards.
class MaskPyramid {
 public:
  /// Bits in vertical strips of 32 cells: cell (x, y) is bit x % 32 of words[x / 32 * rows + y]. So
  /// successive rows are neighbours in memory. A strip of zeros follows the last one, and kPadding
  /// readable words.
  struct Plane {
    const uint32_t* words;
    int rows;
  };
  static constexpr int kPadding = 64;

  MaskPyramid() = default;
  explicit MaskPyramid(ImageSize size);

  /// Copies a mask of size(). The time is proportional to its bounding box. Allocates nothing.
  void build(const Mask& mask);

  ImageSize size() const { return levels_.empty() ? ImageSize{} : levels_.front().size; }

  /// Content of the pixels x0..x1, y0..y1, inclusive and inside the image. kNone and kAll are
  /// always exact. Rectangles of up to 32 x 32 pixels are exact; a larger one may give kSome when
  /// the truth differs within one cell (a 16th of the rectangle) outside its border.
  MaskCoverage coverage(int x0, int y0, int x1, int y1) const;

  /// The finest level on which the rectangle has at most 32 cells along each side.
  static int level_for(int x0, int y0, int x1, int y1) {
    const auto longest = static_cast<unsigned>(x1 - x0 > y1 - y0 ? x1 - x0 : y1 - y0);
    const int n = std::bit_width(longest >> 5);
    // The cells at both ends may stick out.
    const bool fits = (x1 >> n) - (x0 >> n) < 32 && (y1 >> n) - (y0 >> n) < 32;
    return n + static_cast<int>(!fits);
  }
  Plane any(int level) const { return {levels_[level].any.data(), levels_[level].size.height}; }
  Plane all(int level) const {
    return level == 0 ? any(0) : Plane{levels_[level].all.data(), levels_[level].size.height};
  }

 private:
  struct Level {
    ImageSize size;  ///< in cells
    std::vector<uint32_t> any;
    std::vector<uint32_t> all;  ///< empty at level 0, where it equals `any`
  };

  void clear();
  void copy(const Mask& mask);
  /// Fills the cells of `level` that touch filled_ from the level below.
  void halve(int level);

  std::vector<Level> levels_;
  Rect filled_;  ///< pixels outside are 0 on every level
};

}  // namespace v3d::recon
