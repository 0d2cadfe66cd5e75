#include "base/image/mask_components.h"

#include <algorithm>
#include <bit>

namespace v3d {
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
