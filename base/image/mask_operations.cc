#include "base/image/mask_operations.h"

#include <algorithm>
#include <bit>
#include <functional>

#include "base/core/error.h"

namespace v3d {
namespace {

template <class F>
Mask word_by_word(Mask a, const Mask& b, F f) {
  V3D_CHECK(a.size() == b.size());
  for (int y = 0; y < a.size().height; ++y) {
    const auto row = a.row(y);
    std::transform(row.begin(), row.end(), b.row(y).begin(), row.begin(), f);
  }
  return a;
}

/// Calls combine(step) so that it doubles, and then completes, a range of one pixel: after all
/// calls it has `count` pixels. Requires that combine(step) adds the pixels `step` further on.
template <class Combine>
void double_range(int count, const Combine& combine) {
  for (int covered = 1; covered < count;) {
    const int step = std::min(covered, count - covered);
    combine(step);
    covered += step;
  }
}

/// Dilates a row by `radius` columns. The result can have bits in its padding. `upwards`: working
/// memory of the same size.
void grow_row(std::span<uint64_t> row, std::span<uint64_t> upwards, int radius) {
  std::ranges::copy(row, upwards.begin());
  const size_t last = row.size() - 1;
  double_range(radius + 1, [&](int step) {
    for (size_t w = 0; w < last; ++w) row[w] |= row[w] >> step | row[w + 1] << (64 - step);
    row[last] |= row[last] >> step;
    for (size_t w = last; w > 0; --w) {
      upwards[w] |= upwards[w] << step | upwards[w - 1] >> (64 - step);
    }
    upwards[0] |= upwards[0] << step;
  });
  std::ranges::transform(row, upwards, row.begin(), std::bit_or());
}

void clear_padding(Mask& mask) {
  const int used = mask.size().width % 64;
  if (used == 0) return;
  for (int y = 0; y < mask.size().height; ++y) mask.row(y).back() &= (uint64_t{1} << used) - 1;
}

Mask inverse(Mask mask) {
  for (int y = 0; y < mask.size().height; ++y) {
    for (uint64_t& word : mask.row(y)) word = ~word;
  }
  clear_padding(mask);
  return mask;
}

void grow_along_rows(Mask& mask, int radius) {
  std::vector<uint64_t> upwards(static_cast<size_t>(mask.words_per_row()));
  for (int y = 0; y < mask.size().height; ++y) grow_row(mask.row(y), upwards, radius);
  clear_padding(mask);
}

void add_row(std::span<const uint64_t> row, std::span<uint64_t> sum) {
  std::ranges::transform(sum, row, sum.begin(), std::bit_or());
}

void grow_along_columns(Mask& mask, int radius) {
  const int height = mask.size().height;
  Mask downwards = mask;
  double_range(radius + 1, [&](int step) {
    for (int y = 0; y + step < height; ++y) add_row(mask.row(y + step), mask.row(y));
    for (int y = height - 1; y >= step; --y) add_row(downwards.row(y - step), downwards.row(y));
  });
  for (int y = 0; y < height; ++y) add_row(downwards.row(y), mask.row(y));
}

}  // namespace

Mask intersection_of(Mask a, const Mask& b) {
  return word_by_word(std::move(a), b, [](uint64_t x, uint64_t y) { return x & y; });
}
Mask difference_of(Mask a, const Mask& b) {
  return word_by_word(std::move(a), b, [](uint64_t x, uint64_t y) { return x & ~y; });
}
Mask union_of(Mask a, const Mask& b) {
  return word_by_word(std::move(a), b, [](uint64_t x, uint64_t y) { return x | y; });
}

Mask dilate(const Mask& mask, int radius) {
  V3D_CHECK(radius >= 0 && radius <= kMaxRadius);
  Mask result = mask;
  if (mask.words_per_row() == 0) return result;
  grow_along_rows(result, radius);
  grow_along_columns(result, radius);
  return result;
}

Mask erode(const Mask& mask, int radius) { return inverse(dilate(inverse(mask), radius)); }

Mask open(const Mask& mask, int radius) { return dilate(erode(mask, radius), radius); }

namespace {

void clear_run(Mask& mask, const Run& run) {
  const auto row = mask.row(run.y);
  for (int x = run.begin; x < run.end;) {
    const int bit = x % 64;
    const int n = std::min(64 - bit, run.end - x);
    const uint64_t ones = n == 64 ? ~uint64_t{0} : (uint64_t{1} << n) - 1;
    row[x / 64] &= ~(ones << bit);
    x += n;
  }
}

}  // namespace

void append_runs(std::span<const uint64_t> row, int y, std::vector<Run>& runs) {
  uint64_t before = 0;  // the pixel left of the word
  int begin = -1;       // of an unfinished run
  for (size_t w = 0; w < row.size(); ++w) {
    uint64_t changes = row[w] ^ (row[w] << 1 | before);
    before = row[w] >> 63;
    for (; changes != 0; changes &= changes - 1) {
      const int x = static_cast<int>(w) * 64 + std::countr_zero(changes);
      if (begin < 0) {
        begin = x;
      } else {
        runs.push_back({y, begin, x});
        begin = -1;
      }
    }
  }
  if (begin >= 0) runs.push_back({y, begin, static_cast<int>(row.size()) * 64});
}

void MaskComponents::find(const Mask& mask) {
  runs_.clear();
  for (int y = 0; y < mask.size().height; ++y) append_runs(mask.row(y), y, runs_);
  join_touching();
  gather();
}

void MaskComponents::join_touching() {
  const auto count = static_cast<uint32_t>(runs_.size());
  sets_.reset(count);
  uint32_t above = 0;  // first run that can touch the current one
  for (uint32_t i = 0; i < count; ++i) {
    const Run& run = runs_[i];
    const auto ends_before = [&](const Run& r) {
      return r.y < run.y - 1 || (r.y == run.y - 1 && r.end < run.begin);
    };
    while (above < i && ends_before(runs_[above])) ++above;
    for (uint32_t j = above; j < i && runs_[j].y < run.y && runs_[j].begin <= run.end; ++j) {
      sets_.unite(i, j);
    }
  }
}

void MaskComponents::gather() {
  pieces_.clear();
  next_.assign(runs_.size(), kNone);
  piece_of_.resize(runs_.size());
  for (uint32_t i = 0; i < runs_.size(); ++i) {
    const uint32_t first = sets_.find(i);
    if (first == i) {
      piece_of_[i] = static_cast<uint32_t>(pieces_.size());
      pieces_.push_back({i, i, 0});
    } else {
      piece_of_[i] = piece_of_[first];
      next_[pieces_[piece_of_[i]].last] = i;
    }
    Piece& piece = pieces_[piece_of_[i]];
    piece.last = i;
    piece.area += runs_[i].end - runs_[i].begin;
  }
}

void MaskComponents::drop(size_t piece, Mask& mask) {
  for (uint32_t r = pieces_[piece].first; r != kNone; r = next_[r]) {
    clear_run(mask, runs_[r]);
    runs_[r].end = runs_[r].begin;
  }
}

}  // namespace v3d
