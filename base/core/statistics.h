// Percentiles, medians and means of small samples.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

namespace v3d {

/// The value at `index` of the sorted values. Requires index < values.size().
template <class T>
T nth_smallest(std::vector<T> values, size_t index) {
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(index);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

/// Nearest-rank percentile: the smallest value v such that at least `share` (0 to 1) of the values
/// are <= v. It is one of the values, never interpolated; 0 for no values.
template <class T>
T percentile(std::vector<T> values, double share) {
  if (values.empty()) return T{};
  const auto rank = static_cast<size_t>(std::ceil(share * static_cast<double>(values.size())));
  const size_t index = std::clamp<size_t>(rank, 1, values.size()) - 1;
  return nth_smallest(std::move(values), index);
}

/// Median; for an even number of values the larger of the two middle values. 0 for no values.
template <class T>
T upper_median(std::vector<T> values) {
  if (values.empty()) return T{};
  const size_t index = values.size() / 2;
  return nth_smallest(std::move(values), index);
}

/// Median; for an even number of values the mean of the two middle values. 0 for no values.
inline double median(const std::vector<double>& values) {
  return (percentile(values, 0.5) + upper_median(values)) / 2;
}

/// Arithmetic mean; 0 for no values.
inline double mean(const std::vector<double>& values) {
  if (values.empty()) return 0;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

}  // namespace v3d
