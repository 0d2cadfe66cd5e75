#include <algorithm>

#include "recon/skeleton/body_evidence.h"

namespace v3d::recon {
namespace {

/// How far a head can be from the last one: at once, more for each pulse between, at most. Metres.
constexpr double kHeadNearM = 0.05, kHeadStepM = 0.025, kHeadFarM = 0.6;
constexpr int64_t kMaxGap = 40;        ///< pulses between which a head is interpolated
constexpr double kInterpolated = 0.5;  ///< weight of an interpolated head

bool agree(const SeenPulse& earlier, const SeenPulse& later) {
  if (!earlier.evidence->head) return false;
  const auto elapsed = static_cast<double>(later.number - earlier.number);
  const double reach = std::min(kHeadNearM + kHeadStepM * elapsed, kHeadFarM);
  return (*earlier.evidence->head - *later.evidence->head).norm() < reach;
}

HeadPosition seen_head(const SeenPulse& pulse) {
  return {*pulse.evidence->head, *pulse.evidence->neck, 1};
}

/// Sets the heads between those at `from` and `to`.
void interpolate(std::span<const SeenPulse> seen, size_t from, size_t to,
                 std::vector<HeadPosition>& heads) {
  const HeadPosition &a = heads[from], &b = heads[to];
  const auto whole = static_cast<double>(seen[to].number - seen[from].number);
  for (size_t n = from + 1; n < to; ++n) {
    const double t = static_cast<double>(seen[n].number - seen[from].number) / whole;
    heads[n] = {(1 - t) * a.head + t * b.head, (1 - t) * a.neck + t * b.neck, kInterpolated};
  }
}

/// For each pulse the one before it in the longest series that ends with it; -1: none. Sets `last`
/// to the end of the longest series.
std::vector<std::ptrdiff_t> longest_series(std::span<const SeenPulse> seen, std::ptrdiff_t& last) {
  std::vector<int> length(seen.size(), 0);
  std::vector<std::ptrdiff_t> before(seen.size(), -1);
  last = -1;
  for (size_t n = 0; n < seen.size(); ++n) {
    if (!seen[n].evidence->head) continue;
    length[n] = 1;
    for (size_t m = n; m-- > 0 && seen[n].number - seen[m].number <= kMaxGap;) {
      if (length[m] < length[n] || !agree(seen[m], seen[n])) continue;
      length[n] = length[m] + 1;
      before[n] = static_cast<std::ptrdiff_t>(m);
    }
    if (last < 0 || length[n] > length[static_cast<size_t>(last)]) {
      last = static_cast<std::ptrdiff_t>(n);
    }
  }
  return before;
}

}  // namespace

std::vector<HeadPosition> follow_head(std::span<const SeenPulse> seen) {
  std::vector<HeadPosition> heads(seen.size());
  std::ptrdiff_t last = -1;
  const std::vector<std::ptrdiff_t> before = longest_series(seen, last);
  if (last >= 0) heads[static_cast<size_t>(last)] = seen_head(seen[static_cast<size_t>(last)]);
  while (last >= 0) {
    const auto at = static_cast<size_t>(last);
    last = before[at];
    if (last < 0) break;
    const auto from = static_cast<size_t>(last);
    heads[from] = seen_head(seen[from]);
    interpolate(seen, from, at, heads);
  }
  return heads;
}

}  // namespace v3d::recon
