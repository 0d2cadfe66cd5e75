#include "capture/mask_pieces.h"

#include <algorithm>
#include <bit>
#include <numeric>

namespace v3d {
namespace {

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

}  // namespace

std::vector<Run> foreground_runs(const Mask& mask) {
  std::vector<Run> runs;
  for (int y = 0; y < mask.size().height; ++y) append_runs(mask.row(y), y, runs);
  return runs;
}

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

Pieces::Pieces(const std::vector<Run>& runs, Touch touch) : parent_(runs.size()) {
  const int reach = touch == Touch::kEightNeighbours ? 1 : 0;
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

size_t Pieces::piece_of(size_t run) {
  while (parent_[run] != run) run = parent_[run] = parent_[parent_[run]];
  return run;
}

void Pieces::join(size_t a, size_t b) {
  a = piece_of(a);
  b = piece_of(b);
  parent_[std::max(a, b)] = std::min(a, b);
}

}  // namespace v3d
