#include "capture/segmentation/mask_cleanup.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>

#include "base/core/error.h"
#include "base/image/mask_operations.h"

namespace v3d::segmentation {
namespace {

constexpr int kFarLeft = std::numeric_limits<int>::min();
constexpr int kFarRight = std::numeric_limits<int>::max();
/// Gap 0 represents the outside: it always reaches the border.
constexpr uint32_t kOutside = 0;

bool reaches_outside(const Run& gap) { return gap.begin == kFarLeft || gap.end == kFarRight; }

}  // namespace

void MaskHoles::find_gaps(std::span<const Run> runs) {
  gaps_.clear();
  int y = -1;
  int end = kFarLeft;  // of the run before, in row y
  for (const Run& run : runs) {
    if (run.begin == run.end) continue;
    if (run.y != y) {
      if (y >= 0) gaps_.push_back({y, end, kFarRight});
      y = run.y;
      end = kFarLeft;
    }
    gaps_.push_back({y, end, run.begin});
    end = run.end;
  }
  if (y >= 0) gaps_.push_back({y, end, kFarRight});
}

/// Joins touching gaps of two consecutive rows: gaps [above, here) and [here, end).
void MaskHoles::join_rows(size_t above, size_t here, size_t end) {
  const size_t upper_end = here;
  while (above < upper_end && here < end) {
    const Run& upper = gaps_[above];
    const Run& lower = gaps_[here];
    if (upper.begin < lower.end && lower.begin < upper.end) {
      sets_.unite(static_cast<uint32_t>(above), static_cast<uint32_t>(here));
    }
    // The gap that ends first touches no further gap.
    if (upper.end < lower.end) {
      ++above;
    } else {
      ++here;
    }
  }
}

void MaskHoles::join_touching() {
  sets_.reset(gaps_.size());
  const auto next_row = [&](size_t first) {
    size_t i = first;
    while (i < gaps_.size() && gaps_[i].y == gaps_[first].y) ++i;
    return i;
  };
  const auto open = [&](size_t first, size_t end) {
    for (size_t i = first; i < end; ++i) sets_.unite(static_cast<uint32_t>(i), kOutside);
  };
  size_t above = 0;  // first gap of the row before
  for (size_t here = 0; here < gaps_.size();) {
    const size_t end = next_row(here);
    const bool follows = here > 0 && gaps_[here].y == gaps_[above].y + 1;
    if (follows) {
      join_rows(above, here, end);
    } else {  // the rows are separated by an empty row or the border
      open(above, here);
      open(here, end);
    }
    above = here;
    here = end;
  }
  open(above, gaps_.size());
  for (size_t i = 0; i < gaps_.size(); ++i) {
    if (reaches_outside(gaps_[i])) sets_.unite(static_cast<uint32_t>(i), kOutside);
  }
}

void MaskHoles::fill_small(Mask& mask, std::span<const Run> runs, int max_hole) {
  find_gaps(runs);
  join_touching();
  area_.assign(gaps_.size(), 0);
  const auto hole_of = [&](size_t i) { return sets_.find(static_cast<uint32_t>(i)); };
  for (size_t i = 0; i < gaps_.size(); ++i) {
    if (hole_of(i) != kOutside) area_[hole_of(i)] += gaps_[i].end - gaps_[i].begin;
  }
  for (size_t i = 0; i < gaps_.size(); ++i) {
    if (hole_of(i) == kOutside || area_[hole_of(i)] >= max_hole) continue;
    mask.fill_row(gaps_[i].y, gaps_[i].begin, gaps_[i].end);
  }
}

namespace {

// Bit-sliced arithmetic on 64 pixels at a time: each bit of a number has its own word.

constexpr size_t kMaxWords = kMaxImageSide / 64;

/// The sum of three bits per pixel.
struct TwoBits {
  uint64_t ones = 0;
  uint64_t twos = 0;
};

TwoBits add(uint64_t a, uint64_t b, uint64_t c) { return {a ^ b ^ c, (a & b) | (c & (a ^ b))}; }

/// Bits of the pixels whose three numbers (0 to 3 each) add up to 5 or more.
uint64_t at_least_five(TwoBits a, TwoBits b, TwoBits c) {
  const TwoBits ones = add(a.ones, b.ones, c.ones);           // weighs 1, carry 2
  const TwoBits twos = add(a.twos, b.twos, c.twos);           // weighs 2, carry 4
  const uint64_t two = ones.twos ^ twos.ones;                 // weighs 2
  const uint64_t four = (ones.twos & twos.ones) ^ twos.twos;  // weighs 4
  const uint64_t eight = ones.twos & twos.ones & twos.twos;
  return eight | (four & (two | ones.ones));
}

/// For each pixel of a row: how many of it and its left and right neighbours are set (0 to 3).
struct CountedRow {
  bool empty;
  std::array<uint64_t, kMaxWords> ones, twos;

  TwoBits at(size_t w) const { return {ones[w], twos[w]}; }
};

/// Counts a row. `last` is the last bit of the row in its last word. The end pixels are repeated
/// beyond the row.
void count(std::span<const uint64_t> row, int last, CountedRow& counted) {
  const size_t words = row.size();
  counted.empty = std::all_of(row.begin(), row.end(), [](uint64_t w) { return w == 0; });
  std::array<uint64_t, kMaxWords + 2> longer;  // by a word at both ends
  std::copy(row.begin(), row.end(), longer.begin() + 1);
  longer[0] = row[0] << 63;
  const uint64_t end = row[words - 1] >> last & 1;
  longer[words] |= last == 63 ? 0 : end << (last + 1);
  longer[words + 1] = end;
  for (size_t w = 0; w < words; ++w) {
    const uint64_t here = longer[w + 1];
    const TwoBits sum = add(here << 1 | longer[w] >> 63, here, here >> 1 | longer[w + 2] << 63);
    counted.ones[w] = sum.ones;
    counted.twos[w] = sum.twos;
  }
}

}  // namespace

void filter_majority(Mask& mask) {
  const int height = mask.size().height;
  const auto words = static_cast<size_t>(mask.words_per_row());
  if (height == 0 || words == 0) return;
  V3D_CHECK(words <= kMaxWords);
  const int last = (mask.size().width - 1) % 64;
  CountedRow rows[3];
  CountedRow* above = &rows[0];
  CountedRow* here = &rows[1];
  CountedRow* below = &rows[2];
  count(mask.row(0), last, *here);
  count(mask.row(0), last, *above);
  for (int y = 0; y < height; ++y) {
    // The row below is still unmodified. Beyond the last row, that row is repeated.
    if (y + 1 < height) {
      count(mask.row(y + 1), last, *below);
    } else {
      *below = *here;
    }
    if (!above->empty || !here->empty || !below->empty) {
      const auto row = mask.row(y);
      for (size_t w = 0; w < words; ++w) {
        row[w] = at_least_five(above->at(w), here->at(w), below->at(w));
      }
      row[words - 1] &= ~uint64_t{0} >> (63 - last);
    }
    std::swap(above, here);
    std::swap(here, below);
  }
}

namespace {

constexpr int kMaxNotchLength = 8;  // pixels: if half the outline is lost, 0.4 % of gaps are longer
/// Minimum notches per pixel of a frayed outline. Random loss of half the outline gives 0.12 to
/// 0.17.
constexpr double kMinNotchDensity = 0.1;
constexpr int kOutlineMargin = 2;  // pixels from the outline

struct Step {
  int x = 0;
  int y = 0;
};
constexpr Step operator*(int n, Step s) { return {n * s.x, n * s.y}; }
constexpr Step operator+(Step a, Step b) { return {a.x + b.x, a.y + b.y}; }

/// Directions to the side of the foreground and along the outline.
struct Facing {
  Step inward;
  Step along;
};
constexpr Facing kFacings[] = {
    {{0, 1}, {1, 0}}, {{0, -1}, {1, 0}}, {{1, 0}, {0, 1}}, {{-1, 0}, {0, 1}}};

/// Access to a mask by words of 64 pixels. Pixels outside the image are background.
class Words {
 public:
  explicit Words(const Mask& mask) : mask_(mask) {}

  /// Bits of the pixels at offset `step` from those of word `w` of row `y`. Requires an offset of
  /// less than 64 pixels.
  uint64_t at(size_t w, int y, Step step) const {
    const int from = y + step.y;
    if (from < 0 || from >= mask_.size().height) return 0;
    const auto row = mask_.row(from);
    if (step.x == 0) return row[w];
    if (step.x > 0) {
      return row[w] >> step.x | (w + 1 < row.size() ? row[w + 1] << (64 - step.x) : 0);
    }
    return row[w] << -step.x | (w > 0 ? row[w - 1] >> (64 + step.x) : 0);
  }

 private:
  const Mask& mask_;
};

/// Calls visit(w, y, image) for every word in `box`. `image`: the bits of the word that are pixels.
template <class Visit>
void for_each_word(const Mask& mask, const Rect& box, const Visit& visit, int every_row = 1) {
  if (box.empty()) return;
  const auto begin = static_cast<size_t>(std::max(0, box.x0) / 64);
  const auto end = std::min<size_t>(mask.words_per_row(), (box.x0 + box.width + 63) / 64);
  const int tail = mask.size().width % 64;
  const size_t last = mask.words_per_row() - size_t{1};
  const int y_end = std::min(mask.size().height, box.y0 + box.height);
  for (int y = std::max(0, box.y0); y < y_end; y += every_row) {
    for (size_t w = begin; w < end; ++w) {
      visit(w, y, w == last && tail != 0 ? (uint64_t{1} << tail) - 1 : ~uint64_t{0});
    }
  }
}

Rect wider(const Rect& box, int by) {
  if (box.empty()) return box;
  return {box.x0 - by, box.y0 - by, box.width + 2 * by, box.height + 2 * by};
}

/// Dents: background pixels on the outline of `smooth` with foreground inward of them.
class Dents {
 public:
  Dents(const Mask& raw, const Mask& smooth) : raw_(raw), smooth_(smooth) {}

  bool may_exist(size_t w, int y) const {
    return ((smooth_.at(w, y, {0, 1}) ^ smooth_.at(w, y, {0, -1})) |
            (smooth_.at(w, y, {1, 0}) ^ smooth_.at(w, y, {-1, 0}))) != 0;
  }
  uint64_t at(size_t w, int y, Step in, Step here = {}) const {
    return ~raw_.at(w, y, here) & raw_.at(w, y, here + in) & ~raw_.at(w, y, here + -1 * in) &
           smooth_.at(w, y, here + in) & smooth_.at(w, y, here + 2 * in) &
           ~smooth_.at(w, y, here + -1 * in) & ~smooth_.at(w, y, here + -2 * in);
  }

 private:
  Words raw_;
  Words smooth_;
};

/// Pixels with at most one background pixel among the eight neighbours.
uint64_t surrounded(const Words& words, size_t w, int y) {
  uint64_t one = 0, two = 0;
  for (int v = -1; v <= 1; ++v) {
    for (int u = -1; u <= 1; ++u) {
      if (u == 0 && v == 0) continue;
      const uint64_t background = ~words.at(w, y, {u, v});
      two |= one & background;
      one |= background;
    }
  }
  return ~two;
}

Mask without_specks_inside(const Mask& mask, const Rect& box) {
  Mask filled = mask;
  const Words words(mask);
  for_each_word(mask, box, [&](size_t w, int y, uint64_t image) {
    filled.row(y)[w] |= surrounded(words, w, y) & image;
  });
  return filled;
}

/// A pixel of the mask. Pixels outside the image are background.
bool is_set(const Mask& mask, Step at) {
  return at.x >= 0 && at.y >= 0 && at.x < mask.size().width && at.y < mask.size().height &&
         mask.get(at.x, at.y);
}

/// Length of the notch that starts at `first` and continues by `along`; 0 if there is none.
int notch_length(const Mask& mask, Step first, Step along, Step inward) {
  if (!is_set(mask, first + -1 * along)) return 0;
  for (int n = 1; n <= kMaxNotchLength; ++n) {
    const Step here = first + n * along;
    if (is_set(mask, here)) return n;
    if (!is_set(mask, here + inward)) return 0;
  }
  return 0;
}

void fill_notches_from(const Mask& mask, Step first, const Facing& facing, Mask& filled) {
  const Step ways[] = {facing.along, facing.along + facing.inward,
                       facing.along + -1 * facing.inward};
  for (const Step along : ways) {
    const int length = notch_length(mask, first, along, facing.inward);
    for (int n = 0; n < length; ++n) {
      const Step here = first + n * along;
      filled.set(here.x, here.y);
    }
  }
}

Mask filled_notches(const Mask& mask, const Rect& box) {
  Mask filled = mask;
  const Words words(mask);
  for_each_word(mask, box, [&](size_t w, int y, uint64_t image) {
    for (const Facing& facing : kFacings) {
      uint64_t starts = ~words.at(w, y, {}) & words.at(w, y, facing.inward) & image;
      for (; starts != 0; starts &= starts - 1) {
        const int x = static_cast<int>(64 * w) + std::countr_zero(starts);
        fill_notches_from(mask, {x, y}, facing, filled);
      }
    }
  });
  return filled;
}

/// Removes bumps of one or two pixels on the outline, which are noise of the background.
Mask without_bumps(const Mask& mask, const Rect& box) {
  Mask flat = mask;
  const Words words(mask);
  for_each_word(mask, box, [&](size_t w, int y, uint64_t) {
    uint64_t bumps = 0;
    for (const Facing& facing : kFacings) {
      const Step in = facing.inward, along = facing.along;
      const auto sticks_out = [&](Step here) {
        return words.at(w, y, here) & words.at(w, y, here + in) & ~words.at(w, y, here + -1 * in);
      };
      const uint64_t begins = ~words.at(w, y, -1 * along), ends = ~words.at(w, y, along);
      const uint64_t here = sticks_out({});
      bumps |= here & begins & (ends | (sticks_out(along) & ~words.at(w, y, 2 * along)));
      bumps |= here & ends & sticks_out(-1 * along) & ~words.at(w, y, -2 * along);
    }
    flat.row(y)[w] &= ~bumps;
  });
  return flat;
}

/// Notches per pixel of the outline, counted in every `every`-th row.
double notches_per_pixel(const Mask& raw, const Mask& smooth, int every) {
  const Words found(raw), outlined(smooth);
  const Dents dents(raw, smooth);
  int64_t outline = 0, notches = 0;
  const auto count_notches = [&](size_t w, int y, uint64_t image) {
    if (!dents.may_exist(w, y)) return;
    for (const auto& [in, along] : kFacings) {
      outline += std::popcount(~outlined.at(w, y, {}) & outlined.at(w, y, in) & image);
      const uint64_t begins = dents.at(w, y, in) & found.at(w, y, -1 * along) & image;
      if (begins == 0) continue;
      notches += std::popcount(begins & (found.at(w, y, along) |
                                         (dents.at(w, y, in, along) & found.at(w, y, 2 * along))));
    }
  };
  const ImageSize size = smooth.size();
  for_each_word(smooth, {0, 0, size.width, size.height}, count_notches, every);
  return static_cast<double>(notches) / static_cast<double>(std::max<int64_t>(1, outline));
}

}  // namespace

bool is_frayed(const Mask& raw, const Mask& smooth) {
  V3D_CHECK(raw.size() == smooth.size());
  // A test of a few rows first: most outlines are clean.
  return notches_per_pixel(raw, smooth, 8) > kMinNotchDensity / 2 &&
         notches_per_pixel(raw, smooth, 1) > kMinNotchDensity;
}

Mask without_notches(const Mask& raw, const Mask& smooth) {
  V3D_CHECK(raw.size() == smooth.size());
  const Rect box = wider(smooth.bounding_box(), kOutlineMargin);
  const Mask near = intersection_of(raw, dilate(smooth, kOutlineMargin));
  return without_bumps(filled_notches(without_specks_inside(near, box), box), box);
}

}  // namespace v3d::segmentation
