#include "capture/moved_background.h"

#include <algorithm>
#include <vector>

#include "capture/mask_pieces.h"

namespace v3d {
namespace {

constexpr int64_t kSampled = 64;  ///< pixels of a piece that are looked at
/// Percent of them that must be background. Of a moved edge three pixels wide one column lies
/// across the edge; in a Bayer image, which is searched in steps of two, it may be found nowhere.
constexpr int64_t kMostOf = 60;

class Search {
 public:
  Search(ImageView image, const ExpectedBackground& background, int reach)
      : image_(image),
        background_(background),
        channels_(bytes_per_pixel(image.format)),
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
    const uint32_t expected = (background_.mean[sample] * background_.gain) >> 16;
    const uint32_t s = uint32_t{seen} << 7;
    const uint32_t difference = std::max(s, expected) - std::min(s, expected);
    const uint32_t distance = (difference * background_.sharpness[sample]) >> 16;
    return distance * distance;
  }

  ImageView image_;
  const ExpectedBackground& background_;
  int channels_;
  int step_;  ///< between places whose samples have the same colours
  int reach_;
};

/// What is known of a piece while its runs go by.
struct Evidence {
  int64_t area = 0;
  int64_t next = 0;    ///< the pixel to look at, counted through the piece's runs
  int64_t passed = 0;  ///< pixels gone by
  int64_t looked = 0;
  int64_t found = 0;

  int64_t stride() const { return std::max<int64_t>(1, area / kSampled); }
  /// Even if the rest were background, it would not be enough.
  bool settled() const {
    const int64_t samples = (area + stride() - 1) / stride();
    return (looked - found) * 100 > samples * (100 - kMostOf);
  }
  bool is_background() const { return found * 100 >= looked * kMostOf; }
};

void look_at(const Run& run, const Search& search, Evidence& piece) {
  const int64_t end = piece.passed + run.end - run.begin;
  for (; piece.next < end && !piece.settled(); piece.next += piece.stride()) {
    const auto x = static_cast<int>(run.begin + piece.next - piece.passed);
    ++piece.looked;
    piece.found += search.finds(x, run.y) ? 1 : 0;
  }
  piece.passed = end;
}

}  // namespace

void drop_moved_background(Mask& mask, ImageView image, const ExpectedBackground& background,
                           int reach) {
  const std::vector<Run> runs = foreground_runs(mask);
  Pieces pieces(runs, Touch::kEightNeighbours);
  std::vector<Evidence> evidence(runs.size());
  for (size_t i = 0; i < runs.size(); ++i) {
    evidence[pieces.piece_of(i)].area += runs[i].end - runs[i].begin;
  }
  const Search search(image, background, reach);
  for (size_t i = 0; i < runs.size(); ++i) {
    Evidence& piece = evidence[pieces.piece_of(i)];
    if (!piece.settled()) look_at(runs[i], search, piece);
  }
  for (size_t i = 0; i < runs.size(); ++i) {
    if (evidence[pieces.piece_of(i)].is_background()) clear_run(mask, runs[i]);
  }
}

}  // namespace v3d
