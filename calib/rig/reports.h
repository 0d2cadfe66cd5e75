// HTML reports of a rig calibration and of a colour calibration.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "calib/colour/colour_fit.h"
#include "calib/rig/rig_fit.h"

namespace v3d::calib {

// Assessment of a rig calibration: its weaknesses, and an HTML report.

/// One sentence for each weakness, with what to record to improve it; the most severe first.
///
/// Criteria: views shared with neighbours, image coverage, boards without tilt, cameras that fit
/// badly or worse than the others, rejected images, time offsets.
std::vector<std::string> find_weaknesses(const RigFit& fit);

/// One self-contained HTML page: a table of the cameras, the weaknesses, a map of the rig with
/// shared views, and for each camera the coverage and the enlarged residuals.
///
/// `images`: by camera the data URL of a background image, or empty. Deterministic.
std::string rig_report_html(const Board& board, const RigFit& fit,
                            const std::vector<std::string>& images);

// HTML report of a colour calibration.

/// One self-contained HTML page: a table of the cameras, and the colours that each camera observes
/// at some of the places, before and after. `cameras`: names, as in `fit`. Deterministic.
std::string colour_report_html(const std::vector<std::string>& cameras, const ColourFit& fit,
                               std::span<const ColourSample> samples);

}  // namespace v3d::calib
