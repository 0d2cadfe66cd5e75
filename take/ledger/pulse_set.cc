#include "take/ledger/pulse_set.h"

#include <algorithm>
#include <iterator>

namespace v3d {
namespace {

/// Appends the numbers from `first` to `last`; none if `first` > `last`.
void append(int64_t first, int64_t last, std::vector<int64_t>& numbers) {
  if (first > last) return;
  for (; first < last; ++first) numbers.push_back(first);
  numbers.push_back(last);
}

}  // namespace

bool PulseSet::contains(int64_t pulse) const {
  const auto next_run = runs_.upper_bound(pulse);
  return next_run != runs_.begin() && pulse <= std::prev(next_run)->second;
}

bool PulseSet::insert(int64_t pulse) {
  if (contains(pulse)) return false;
  ++size_;
  const auto next_run = runs_.upper_bound(pulse);
  const bool joins_next = next_run != runs_.end() && next_run->first - 1 == pulse;
  const int64_t last = joins_next ? next_run->second : pulse;
  const bool joins_previous = next_run != runs_.begin() && std::prev(next_run)->second + 1 == pulse;
  if (joins_previous) {
    std::prev(next_run)->second = last;
  } else {
    runs_.emplace(pulse, last);
  }
  if (joins_next) runs_.erase(next_run);
  return true;
}

std::vector<int64_t> PulseSet::all() const {
  std::vector<int64_t> all;
  all.reserve(static_cast<size_t>(size_));
  for (const auto& [first, last] : runs_) append(first, last, all);
  return all;
}

std::vector<int64_t> PulseSet::outside(int64_t commanded) const {
  std::vector<int64_t> outside;
  for (const auto& [first, last] : runs_) {
    append(first, std::min<int64_t>(last, -1), outside);
    append(std::max(first, commanded), last, outside);
  }
  return outside;
}

std::vector<int64_t> PulseSet::missing(int64_t commanded) const {
  std::vector<int64_t> missing;
  int64_t next = 0;
  const auto append_missing_until = [&](int64_t end) {
    for (; next < end; ++next) missing.push_back(next);
  };
  for (const auto& [first, last] : runs_) {
    append_missing_until(std::min(first, commanded));
    if (last >= commanded) return missing;
    next = std::max(next, last + 1);
  }
  append_missing_until(commanded);
  return missing;
}

}  // namespace v3d
