#include "capture/segmentation/segmenter.h"

#include <algorithm>
#include <span>

#include "base/core/error.h"
#include "capture/segmentation/image_measures.h"

namespace v3d::segmentation {
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
  adaptation_.adapt(image, mask, brightness_ratio(image, table_.mean), table_);
}

void Segmenter::restore_plates() {
  learnt_ = -1;
  adaptation_.restore_plates(table_);
}

namespace {

constexpr int64_t kMaxSamples = 64;  ///< pixels of a piece that are tested
/// Percent of them that must be background. Of a moved edge three pixels wide, one column lies
/// across the edge. In a Bayer image, which is searched in steps of two, it may have no match.
constexpr int64_t kMinBackgroundPercent = 60;

/// Searches the expected background near a quad of the image.
class Search {
 public:
  Search(ImageView image, const ExpectedBackground& background, int reach)
      : image_(image),
        background_(background),
        channels_(background.table.channels),
        step_(is_bayer(image.format) ? 2 : 1),
        reach_(reach / step_ * step_) {}

  /// True if the quad at (x, y) matches the background expected at a place within reach. Only
  /// places with the same order of colours are compared.
  bool has_match(int x, int y) const {
    const int right = image_.size.width - 2;
    const int bottom = image_.size.height - 2;
    x = std::min(x, right);
    y = std::min(y, bottom);
    for (int v = y - reach_; v <= y + reach_; v += step_) {
      for (int u = x - reach_; u <= x + reach_; u += step_) {
        if (u < 0 || v < 0 || u > right || v > bottom) continue;
        if (matches_at(x, y, u, v)) return true;
      }
    }
    return false;
  }

 private:
  bool matches_at(int x, int y, int u, int v) const {
    uint32_t sum = 0;
    for (int row = 0; row < 2 && sum <= background_.quad_limit; ++row) {
      const uint8_t* seen = image_.row(y + row) + x * channels_;
      const size_t there = (static_cast<size_t>(v + row) * image_.size.width + u) * channels_;
      for (int i = 0; i < 2 * channels_; ++i) sum += squared_distance(seen[i], there + i);
    }
    return sum <= background_.quad_limit;
  }

  uint32_t squared_distance(uint8_t seen, size_t sample) const {
    const BackgroundTable& table = background_.table;
    const uint32_t expected =
        std::min<uint32_t>((table.mean[sample] * background_.gain) >> 16, kMaxExpected);
    const uint32_t s = uint32_t{seen} << 7;
    const uint32_t difference = std::max(s, expected) - std::min(s, expected);
    const uint32_t sharpness = uint32_t{table.sharpness[sample]} << table.sharpness_shift;
    const uint32_t distance = (difference * sharpness) >> 16;
    return distance * distance;
  }

  ImageView image_;
  const ExpectedBackground& background_;
  int channels_;
  int step_;  ///< between places with the same order of colours, pixels
  int reach_;
};

/// Counts the tested pixels of a piece that match the background, run by run.
class Evidence {
 public:
  explicit Evidence(int64_t area)
      : stride_(std::max<int64_t>(1, area / kMaxSamples)),
        samples_((area + stride_ - 1) / stride_) {}

  void test_run(const Run& run, const Search& search) {
    const int64_t end = passed_ + run.end - run.begin;
    for (; next_ < end && !is_decided(); next_ += stride_) {
      const auto x = static_cast<int>(run.begin + next_ - passed_);
      ++tested_;
      matching_ += search.has_match(x, run.y) ? 1 : 0;
    }
    passed_ = end;
  }
  /// True if the piece cannot be background, even if all remaining pixels match.
  bool is_decided() const {
    return (tested_ - matching_) * 100 > samples_ * (100 - kMinBackgroundPercent);
  }
  bool is_background() const { return matching_ * 100 >= tested_ * kMinBackgroundPercent; }

 private:
  int64_t stride_;
  int64_t samples_;       ///< pixels to test
  int64_t next_ = 0;      ///< next pixel to test, counted along the piece's runs
  int64_t passed_ = 0;    ///< pixels of the runs so far
  int64_t tested_ = 0;    ///< pixels tested
  int64_t matching_ = 0;  ///< pixels that match the background
};

}  // namespace

bool is_moved_background(const MaskComponents& pieces, size_t piece, ImageView image,
                         const ExpectedBackground& background, int reach) {
  const Search search(image, background, reach);
  Evidence evidence(pieces.area(piece));
  pieces.for_each_run(piece, [&](const Run& run) {
    evidence.test_run(run, search);
    return !evidence.is_decided();
  });
  return evidence.is_background();
}

}  // namespace v3d::segmentation
