#include "capture/segmentation/outline_repair.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>

#include "base/core/check.h"
#include "base/image/mask_morphology.h"

namespace v3d {
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

}  // namespace v3d
