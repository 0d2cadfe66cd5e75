// A calibration as a page for people: one HTML file with its pictures in it.
#pragma once

#include <string>
#include <vector>

#include "calib/rig/rig_fit.h"

namespace v3d::calib {

/// A table of the cameras, what is weak and what to record to mend it, the rig from above with the
/// views that cameras share, and of every camera its image: where corners were seen, and arrows by
/// how much they miss, enlarged. `pictures`: by camera an image to lay beneath, a data_url(), or
/// empty. Needs nothing but a browser. The same fit gives the same text.
std::string report_html(const Board& board, const RigFit& fit,
                        const std::vector<std::string>& pictures);

}  // namespace v3d::calib
