// HTML report of a colour calibration.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "calib/colour/colour_fit.h"

namespace v3d::calib {

/// One self-contained HTML page: a table of the cameras, and the colours that each camera observes
/// at some of the places, before and after. `cameras`: names, as in `fit`. Deterministic.
std::string colour_report_html(const std::vector<std::string>& cameras, const ColourFit& fit,
                               std::span<const ColourSample> samples);

}  // namespace v3d::calib
