// Colour samples from images of charts and grey cards, and black levels from dark images.
#pragma once

#include <string>
#include <vector>

#include "calib/colour/colour_fit.h"
#include "calibrate/rig_boards.h"

namespace v3d::calibrate {

/// Samples of a colour chart with 24 patches, of at most 20 images of each camera. The camera index
/// of a sample refers to `names`. Throws InputError for a camera that is not in `names`, and for a
/// camera without a chart in its images.
std::vector<calib::ColourSample> find_charts(std::vector<NamedSource> sources,
                                             const std::vector<std::string>& names);

/// Samples of a grey card that fills the middle of the images. Throws InputError for a camera that
/// is not in `names`.
std::vector<calib::ColourSample> find_grey(std::vector<NamedSource> sources,
                                           const std::vector<std::string>& names);

/// Black levels by camera of `names`, from images with covered lenses. Throws InputError for a
/// camera that is not in `names`, and for a name without a source.
std::vector<Eigen::Vector3d> find_black(std::vector<NamedSource> sources,
                                        const std::vector<std::string>& names);

}  // namespace v3d::calibrate
