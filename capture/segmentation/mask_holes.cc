#include "capture/segmentation/mask_holes.h"

#include <algorithm>
#include <limits>

namespace v3d {
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

}  // namespace v3d
