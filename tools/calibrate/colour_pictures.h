// Charts, grey cards and covered lenses in pictures.
#pragma once

#include <string>
#include <vector>

#include "calib/colour/colour_fit.h"
#include "calibrate/rig_boards.h"

namespace v3d::calibrate {

/// What a camera's pictures say of a colour chart, of a grey card that fills the middle of them, or
/// of black; by camera of `names`. All throw InputError for a source whose camera is not among
/// them, and find_charts() for a camera in none of whose pictures a chart is found.
std::vector<calib::ColourSample> find_charts(std::vector<NamedSource> sources,
                                             const std::vector<std::string>& names);
std::vector<calib::ColourSample> find_grey(std::vector<NamedSource> sources,
                                           const std::vector<std::string>& names);
/// Requires sources of all cameras, or throws InputError.
std::vector<Eigen::Vector3d> find_black(std::vector<NamedSource> sources,
                                        const std::vector<std::string>& names);

}  // namespace v3d::calibrate
