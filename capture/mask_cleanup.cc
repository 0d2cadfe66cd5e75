#include "capture/mask_cleanup.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <utility>
#include <vector>

namespace v3d {
namespace {

// ---- Majority, 64 pixels at a time: numbers are kept bit by bit in separate words.

/// The sum of three bits per pixel.
struct TwoBits {
  uint64_t ones = 0;
  uint64_t twos = 0;
};

TwoBits add(uint64_t a, uint64_t b, uint64_t c) { return {a ^ b ^ c, (a & b) | (c & (a ^ b))}; }

/// How many of a pixel and its neighbours left and right are set. `last` is the last bit of the row
/// in its last word; beyond the ends the row goes on as it ends.
TwoBits count_in_row(std::span<const uint64_t> row, size_t w, int last) {
  const bool at_end = w + 1 == row.size();
  const uint64_t left = (row[w] << 1) | (w > 0 ? row[w - 1] >> 63 : row[w] & 1);
  const uint64_t right =
      (row[w] >> 1) | (at_end ? row[w] & (uint64_t{1} << last) : row[w + 1] << 63);
  return add(left, row[w], right);
}

/// Where three numbers of 0 to 3 sum up to 5 or more.
uint64_t at_least_five(TwoBits a, TwoBits b, TwoBits c) {
  const TwoBits ones = add(a.ones, b.ones, c.ones);           // weighs 1, carry 2
  const TwoBits twos = add(a.twos, b.twos, c.twos);           // weighs 2, carry 4
  const uint64_t two = ones.twos ^ twos.ones;                 // weighs 2
  const uint64_t four = (ones.twos & twos.ones) ^ twos.twos;  // weighs 4
  const uint64_t eight = ones.twos & twos.ones & twos.twos;
  return eight | (four & (two | ones.ones));
}

// ---- Connected pieces as runs of a row, joined by union-find.

struct Run {
  int y = 0;
  int begin = 0;
  int end = 0;
};

/// The runs of set bits of `row`, x in [0, width).
void append_runs(std::span<const uint64_t> row, int y, std::vector<Run>& runs) {
  int begin = -1;  // of an unfinished run
  for (size_t w = 0; w < row.size(); ++w) {
    const int base = static_cast<int>(w) * 64;
    if (row[w] == 0 && begin < 0) continue;
    if (row[w] == ~uint64_t{0} && begin >= 0) continue;
    int x = 0;
    while (x < 64) {
      const uint64_t rest = row[w] >> x;
      if (begin < 0) {
        if (rest == 0) break;
        x += std::countr_zero(rest);
        begin = base + x;
      } else {
        const int ones = std::countr_one(rest);
        if (x + ones >= 64) break;
        x += ones;
        runs.push_back({y, begin, base + x});
        begin = -1;
      }
    }
  }
  if (begin >= 0) runs.push_back({y, begin, static_cast<int>(row.size()) * 64});
}

class Pieces {
 public:
  /// `reach`: 1 joins diagonal neighbours, 0 does not.
  Pieces(const std::vector<Run>& runs, int reach) : parent_(runs.size()) {
    std::iota(parent_.begin(), parent_.end(), 0);
    size_t above = 0;  // first run that can touch the current one
    for (size_t i = 0; i < runs.size(); ++i) {
      const auto ends_before = [&](const Run& r) {
        return r.y < runs[i].y - 1 || (r.y == runs[i].y - 1 && r.end + reach <= runs[i].begin);
      };
      while (above < i && ends_before(runs[above])) ++above;
      for (size_t j = above; j < i && runs[j].y < runs[i].y; ++j) {
        if (runs[j].begin >= runs[i].end + reach) break;
        join(i, j);
      }
    }
  }

  size_t piece_of(size_t run) {
    while (parent_[run] != run) run = parent_[run] = parent_[parent_[run]];
    return run;
  }

 private:
  void join(size_t a, size_t b) {
    a = piece_of(a);
    b = piece_of(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

  std::vector<size_t> parent_;
};

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

/// Background runs, cut at the image's width.
std::vector<Run> background_runs(const Mask& mask) {
  const ImageSize size = mask.size();
  std::vector<Run> runs;
  std::vector<uint64_t> inverted(mask.words_per_row());
  for (int y = 0; y < size.height; ++y) {
    const auto row = mask.row(y);
    std::transform(row.begin(), row.end(), inverted.begin(), [](uint64_t w) { return ~w; });
    if (size.width % 64) inverted.back() &= (uint64_t{1} << size.width % 64) - 1;
    append_runs(inverted, y, runs);
  }
  return runs;
}

}  // namespace

void take_majority(Mask& mask) {
  const int height = mask.size().height;
  const auto words = static_cast<size_t>(mask.words_per_row());
  if (height == 0 || words == 0) return;
  const int last = (mask.size().width - 1) % 64;
  const uint64_t inside = ~uint64_t{0} >> (63 - last);
  std::vector<TwoBits> above(words);
  std::vector<TwoBits> here(words);
  std::vector<TwoBits> below(words);
  for (size_t w = 0; w < words; ++w) here[w] = count_in_row(mask.row(0), w, last);
  above = here;
  for (int y = 0; y < height; ++y) {
    const auto next = std::as_const(mask).row(std::min(y + 1, height - 1));
    for (size_t w = 0; w < words; ++w) {
      below[w] = y + 1 < height ? count_in_row(next, w, last) : here[w];
    }
    const auto row = mask.row(y);
    for (size_t w = 0; w < words; ++w) row[w] = at_least_five(above[w], here[w], below[w]);
    row[words - 1] &= inside;
    std::swap(above, here);
    std::swap(here, below);
  }
}

void drop_small_pieces(Mask& mask, int min_area) {
  std::vector<Run> runs;
  for (int y = 0; y < mask.size().height; ++y) append_runs(std::as_const(mask).row(y), y, runs);
  Pieces pieces(runs, 1);
  std::vector<int64_t> area(runs.size());
  for (size_t i = 0; i < runs.size(); ++i) {
    area[pieces.piece_of(i)] += runs[i].end - runs[i].begin;
  }
  for (size_t i = 0; i < runs.size(); ++i) {
    if (area[pieces.piece_of(i)] < min_area) clear_run(mask, runs[i]);
  }
}

void fill_small_holes(Mask& mask, int max_hole) {
  const ImageSize size = mask.size();
  const std::vector<Run> runs = background_runs(mask);
  Pieces pieces(runs, 0);
  std::vector<int64_t> area(runs.size());
  for (size_t i = 0; i < runs.size(); ++i) {
    const Run& r = runs[i];
    const bool at_border =
        r.y == 0 || r.y == size.height - 1 || r.begin == 0 || r.end == size.width;
    area[pieces.piece_of(i)] += at_border ? std::max<int64_t>(max_hole, 0) : r.end - r.begin;
  }
  for (size_t i = 0; i < runs.size(); ++i) {
    if (area[pieces.piece_of(i)] < max_hole) mask.fill_row(runs[i].y, runs[i].begin, runs[i].end);
  }
}

}  // namespace v3d
