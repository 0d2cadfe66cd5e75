// The value in the middle.
#pragma once

#include <algorithm>
#include <vector>

namespace v3d::calib {

/// Of an even number the upper one of the two in the middle; 0 of none.
inline double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<long>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace v3d::calib
