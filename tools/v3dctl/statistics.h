// Order statistics for reports.
#pragma once

#include <vector>

namespace v3d::ctl {

/// The smallest value that at least `percent` of all do not exceed (nearest rank); 0 of nothing.
double percentile(std::vector<double> values, double percent);

/// The mean of the two middle values when their number is even; 0 of nothing.
double median(std::vector<double> values);

double mean(const std::vector<double>& values);

}  // namespace v3d::ctl
