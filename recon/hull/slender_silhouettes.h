// Widening of slender parts of silhouettes, so that a hull does not break there.
#pragma once

#include <cstdint>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/image/mask.h"

namespace v3d::recon {

/// Sizes in pixels for one camera.
struct SlenderSizes {
  int side = 1;   ///< a part is slender where no square of this side fits into the silhouette
  int gap = 0;    ///< side of the square that closes gaps between slender pixels; 0: none
  int reach = 0;  ///< slender parts are widened by this much to all sides; 0: no change at all

  /// For voxels of `voxel_m` metres in the middle of `space` (world, metres). Parts thinner than
  /// two voxels are slender, gaps of less than six voxels are closed, and parts are widened by at
  /// most 0.65 voxels, in whole pixels. Where this is less than a pixel, nothing is changed.
  static SlenderSizes for_camera(const CameraModel& camera, const Box& space, double voxel_m);

  friend bool operator==(const SlenderSizes&, const SlenderSizes&) = default;
};

/// Repairs slender parts, such as the blade of a sword, which would break: a voxel is sampled at
/// its centre only, and silhouettes have gaps where a thin part looks like the background.
///
/// Normative definition of the result. A pixel is *thick* when a square of side x side foreground
/// pixels contains it (morphological opening). All other foreground is *slender*. The slender
/// pixels are closed by a square of gap x gap pixels (morphological closing), and the result is
/// widened: a pixel within `reach` pixels of it along both axes is foreground. All foreground stays
/// foreground. The hull is that of these silhouettes: only space that they allow in all cameras is
/// added.
///
/// Keeps its working memory between calls. One caller at a time. Vectorised by run-time dispatch;
/// every instruction set gives the same bits. The time is proportional to the bounding box of the
/// foreground.
/// Source of the opening and of its residue, the top-hat: Serra, Image Analysis and Mathematical
/// Morphology, 1982.
class SlenderSilhouettes {
 public:
  static constexpr SlenderSizes kMax{.side = 60, .gap = 60, .reach = 15};

  /// Requires a side of at least 1, and no size above kMax.
  SlenderSilhouettes(ImageSize size, const SlenderSizes& sizes);

  /// Returns the widened silhouette, valid until the next call; `mask` itself where nothing is
  /// slender. Requires a mask of the size of the constructor.
  const Mask& widen(const Mask& mask);

 private:
  /// Words of the rows around the foreground. One word of zeros follows each row. Rows above the
  /// image take up what the closing moves there.
  struct Region {
    int first_word = 0, words = 0;
    int first_row = 0, rows = 0;
    size_t stride() const { return static_cast<size_t>(words) + 1; }
    size_t size() const { return stride() * static_cast<size_t>(rows); }
  };
  /// A plane of bits with zeros before and behind it, so that neighbours can always be read.
  struct Plane {
    std::vector<uint64_t> words;
    size_t margin = 0;
    uint64_t* data() { return words.data() + margin; }
  };
  Region region_of(const Rect& box) const;
  void load(const Mask& mask, const Region& region);
  /// Leaves the slender pixels in bits_. Returns false when there are none.
  bool find_slender(const Region& region);
  void close_gaps(const Region& region);
  void widen_slender(const Region& region);
  void store(const Mask& mask, const Region& region);
  /// Combine each pixel with the one `step` pixels, or `distance` words, away.
  using PixelStep = void (*)(const uint64_t* in, size_t words, int step, uint64_t* out);
  using RowStep = void (*)(const uint64_t* in, size_t words, int64_t distance, uint64_t* out);
  /// Replaces each pixel of bits_ by the combination of a square of count x count pixels that
  /// begins at it, in steps that double. `row_words`: words to the next row of the square.
  void combine(int count, PixelStep pixels, RowStep rows, int64_t row_words, const Region& region);

  SlenderSizes sizes_;
  Plane foreground_, bits_, next_;
  Mask widened_;
};

}  // namespace v3d::recon
