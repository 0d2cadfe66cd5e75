#include "capture/segmentation/moved_background.h"

#include <algorithm>

namespace v3d {
namespace {

constexpr int64_t kSampled = 64;  ///< pixels of a piece that are looked at
/// Percent of them that must be background. Of a moved edge three pixels wide one column lies
/// across the edge; in a Bayer image, which is searched in steps of two, it may be found nowhere.
constexpr int64_t kMaxOf = 60;

class Search {
 public:
  Search(ImageView image, const ExpectedBackground& background, int reach)
      : image_(image),
        background_(background),
        channels_(background.table.channels),
        step_(is_bayer(image.format) ? 2 : 1),
        reach_(reach / step_ * step_) {}

  /// The quad at (x, y) is what the model expects of some place within reach, of the same colours.
  bool finds(int x, int y) const {
    const int right = image_.size.width - 2;
    const int bottom = image_.size.height - 2;
    x = std::min(x, right);
    y = std::min(y, bottom);
    for (int v = y - reach_; v <= y + reach_; v += step_) {
      for (int u = x - reach_; u <= x + reach_; u += step_) {
        if (u < 0 || v < 0 || u > right || v > bottom) continue;
        if (looks_alike(x, y, u, v)) return true;
      }
    }
    return false;
  }

 private:
  bool looks_alike(int x, int y, int u, int v) const {
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
  int step_;  ///< between places whose samples have the same colours
  int reach_;
};

/// What is known of a piece while its runs go by.
class Evidence {
 public:
  explicit Evidence(int64_t area)
      : stride_(std::max<int64_t>(1, area / kSampled)), samples_((area + stride_ - 1) / stride_) {}

  void look_at(const Run& run, const Search& search) {
    const int64_t end = passed_ + run.end - run.begin;
    for (; next_ < end && !settled(); next_ += stride_) {
      const auto x = static_cast<int>(run.begin + next_ - passed_);
      ++looked_;
      found_ += search.finds(x, run.y) ? 1 : 0;
    }
    passed_ = end;
  }
  /// Even if the rest were background, it would not be enough.
  bool settled() const { return (looked_ - found_) * 100 > samples_ * (100 - kMaxOf); }
  bool is_background() const { return found_ * 100 >= looked_ * kMaxOf; }

 private:
  int64_t stride_;
  int64_t samples_;     ///< pixels to look at
  int64_t next_ = 0;    ///< the next of them, counted through the piece's runs
  int64_t passed_ = 0;  ///< pixels gone by
  int64_t looked_ = 0;
  int64_t found_ = 0;
};

}  // namespace

bool is_moved_background(const MaskComponents& pieces, size_t piece, ImageView image,
                         const ExpectedBackground& background, int reach) {
  const Search search(image, background, reach);
  Evidence evidence(pieces.area(piece));
  pieces.for_each_run(piece, [&](const Run& run) {
    evidence.look_at(run, search);
    return !evidence.settled();
  });
  return evidence.is_background();
}

}  // namespace v3d
