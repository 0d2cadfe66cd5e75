#include "capture/mask_cleanup.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "capture/mask_pieces.h"

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
  const std::vector<Run> runs = foreground_runs(mask);
  Pieces pieces(runs, Touch::kEightNeighbours);
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
  Pieces pieces(runs, Touch::kFourNeighbours);
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
