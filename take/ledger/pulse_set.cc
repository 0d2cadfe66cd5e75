#include "take/ledger/pulse_set.h"

#include <algorithm>
#include <iterator>

namespace v3d {
namespace {

/// The numbers from `first` to `last`, if there are any.
void append(int64_t first, int64_t last, std::vector<int64_t>& numbers) {
  if (first > last) return;
  for (; first < last; ++first) numbers.push_back(first);
  numbers.push_back(last);
}

}  // namespace

bool PulseSet::contains(int64_t pulse) const {
  const auto behind = runs_.upper_bound(pulse);
  return behind != runs_.begin() && pulse <= std::prev(behind)->second;
}

bool PulseSet::insert(int64_t pulse) {
  if (contains(pulse)) return false;
  ++size_;
  const auto behind = runs_.upper_bound(pulse);
  const bool joins_behind = behind != runs_.end() && behind->first - 1 == pulse;
  const int64_t last = joins_behind ? behind->second : pulse;
  const bool joins_before = behind != runs_.begin() && std::prev(behind)->second + 1 == pulse;
  if (joins_before) {
    std::prev(behind)->second = last;
  } else {
    runs_.emplace(pulse, last);
  }
  if (joins_behind) runs_.erase(behind);
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
  const auto note_until = [&](int64_t end) {
    for (; next < end; ++next) missing.push_back(next);
  };
  for (const auto& [first, last] : runs_) {
    note_until(std::min(first, commanded));
    if (last >= commanded) return missing;
    next = std::max(next, last + 1);
  }
  note_until(commanded);
  return missing;
}

}  // namespace v3d
