// A calibration of colour as a page for people.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "calib/colour/colour_fit.h"

namespace v3d::calib {

/// A table of the cameras, and for some of the places what every camera shows of them, before and
/// after. Needs nothing but a browser. The same fit gives the same text.
std::string colour_report_html(const std::vector<std::string>& cameras, const ColourFit& fit,
                               std::span<const ColourSample> samples);

}  // namespace v3d::calib
