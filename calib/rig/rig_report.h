// Assessment of a rig calibration: its weaknesses, and an HTML report.
#pragma once

#include <string>
#include <vector>

#include "calib/rig/rig_fit.h"

namespace v3d::calib {

/// One sentence for each weakness, with what to record to improve it; the most severe first.
///
/// Criteria: views shared with neighbours, image coverage, cameras that fit worse than the others,
/// rejected images, time offsets.
std::vector<std::string> find_weaknesses(const RigFit& fit);

/// One self-contained HTML page: a table of the cameras, the weaknesses, a map of the rig with
/// shared views, and for each camera the coverage and the enlarged residuals.
///
/// `images`: by camera the data_url() of a background image, or empty. Deterministic.
std::string rig_report_html(const Board& board, const RigFit& fit,
                            const std::vector<std::string>& images);

}  // namespace v3d::calib
