#include "capture/segmentation/segmenter.h"

#include <algorithm>
#include <span>

#include "base/core/check.h"
#include "capture/segmentation/brightness.h"
#include "capture/segmentation/moved_background.h"

namespace v3d {
namespace {

/// Bits whose left neighbour is set. Outside the left border counts as set.
uint64_t from_left(std::span<const uint64_t> row, size_t w) {
  return (row[w] << 1) | (w > 0 ? row[w - 1] >> 63 : 1);
}

/// The pixels all of whose quads differ.
Mask combine(const Mask& quads) {
  Mask mask(quads.size());
  const int height = mask.size().height;
  const int tail = mask.size().width % 64;
  const uint64_t last_word = tail ? (uint64_t{1} << tail) - 1 : ~uint64_t{0};
  for (int y = 0; y < height; ++y) {
    const auto above = quads.row(std::max(y - 1, 0));
    const auto below = quads.row(std::min(y, height - 2));
    const auto row = mask.row(y);
    for (size_t w = 0; w < row.size(); ++w) {
      row[w] = above[w] & from_left(above, w) & below[w] & from_left(below, w);
    }
    row[row.size() - 1] &= last_word;
  }
  return mask;
}

}  // namespace

Segmenter::Segmenter(const BackgroundModel& model, const SegmentOptions& options)
    : options_(options),
      table_(model, options),
      quad_test_(table_, options),
      quads_(table_),
      adaptation_(table_) {}

Mask Segmenter::segment(ImageView image) {
  V3D_CHECK(image.size == size() && image.format == format());
  if (image.size.width < 2 || image.size.height < 2) return Mask(image.size);
  const uint32_t gain = brightness_ratio(image, table_.mean);
  Mask mask = combine(quads_.find(image, table_, quad_test_, gain));
  const ExpectedBackground background{table_, gain, quad_test_.limit};
  cleanup_.clean(mask, options_, [&](const MaskComponents& pieces, size_t i) {
    return is_moved_background(pieces, i, image, background, options_.moved);
  });
  return mask;
}

void Segmenter::learn(int64_t pulse, ImageView image, const Mask& mask) {
  V3D_CHECK(learns_from(pulse));
  learnt_ = pulse;
  adaptation_.follow(image, mask, brightness_ratio(image, table_.mean), table_);
}

void Segmenter::forget() {
  learnt_ = -1;
  adaptation_.forget(table_);
}

}  // namespace v3d
