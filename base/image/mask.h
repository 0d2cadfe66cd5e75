// Mask: a silhouette with one bit per pixel, 1 = foreground.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/image/image.h"

namespace v3d {

/// Bit mask of an image. Rows are padded to whole 64-bit words; pixel x of a row is bit x % 64
/// (least significant first) of word x / 64.
/// Invariant: padding bits are 0, so that whole words can be counted and compared.
class Mask {
 public:
  Mask() = default;
  /// All pixels are background.
  explicit Mask(ImageSize size);

  ImageSize size() const { return size_; }
  int words_per_row() const { return words_per_row_; }
  std::span<const uint64_t> row(int y) const {
    return {words_.data() + static_cast<size_t>(y) * words_per_row_,
            static_cast<size_t>(words_per_row_)};
  }
  /// Writers must keep the padding bits 0.
  std::span<uint64_t> row(int y) {
    return {words_.data() + static_cast<size_t>(y) * words_per_row_,
            static_cast<size_t>(words_per_row_)};
  }

  bool get(int x, int y) const {
    return (words_[static_cast<size_t>(y) * words_per_row_ + x / 64] >> (x % 64)) & 1;
  }
  void set(int x, int y, bool foreground = true) {
    uint64_t& word = words_[static_cast<size_t>(y) * words_per_row_ + x / 64];
    const uint64_t bit = uint64_t{1} << (x % 64);
    word = foreground ? word | bit : word & ~bit;
  }
  /// Sets pixels [x_begin, x_end) of a row to foreground.
  void fill_row(int y, int x_begin, int x_end);

  /// The number of foreground pixels.
  int64_t count() const;
  /// The smallest rectangle that contains all foreground; empty() when there is none.
  Rect bounding_box() const;

  friend bool operator==(const Mask&, const Mask&) = default;

 private:
  ImageSize size_;
  int words_per_row_ = 0;
  std::vector<uint64_t> words_;
};

/// Run-length code of the whole mask, row-major; runs continue across rows.
/// The code is the lengths of alternating runs as LEB128 numbers. The first run is background (its
/// length can be 0); the last run is included. The sum of the lengths is width * height.
std::vector<uint8_t> encode_runs(const Mask& mask);

/// Inverse of encode_runs(). Safe for untrusted bytes: empty for a wrong sum, overlong numbers,
/// trailing bytes, and sizes beyond kMaxImageSide.
std::optional<Mask> decode_runs(std::span<const uint8_t> runs, ImageSize size);

/// Converts an 8-bit image: values of 128 or more are foreground. Requires format Mono8.
Mask mask_from_image(ImageView image);
/// Converts to an image of format Mono8: background 0, foreground 255.
Image image_from_mask(const Mask& mask);

/// |a and b| / |a or b|; 1 when both are empty. Requires equal sizes.
double intersection_over_union(const Mask& a, const Mask& b);

}  // namespace v3d
