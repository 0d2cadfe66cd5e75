// Colour samples from images of charts and grey cards, and black levels from dark images.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/geometry/camera_model.h"
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

// Colour samples of places that several cameras of a take observe: on the surface and on the floor.

/// Samples of places on the reconstructed surface, in up to 10 frames spread over the take.
///
/// Places are numbered from `first_place`. A camera contributes where it faces the place without
/// occlusion, and where the colours around it are well exposed and uniform. `rig`: contains all
/// cameras of the take. Throws InputError for a take without meshes.
std::vector<calib::ColourSample> surface_places(const std::filesystem::path& take, const Rig& rig,
                                                int first_place);

/// Samples of places on the floor (z = 0) between the cameras, from the background plates.
///
/// Empty where the take has no plates. Objects on the floor cause wrong samples, which fit_views()
/// treats as outliers. Throws InputError where cameras are more than 200 m apart, and for plates of
/// another size than the images of the calibration.
std::vector<calib::ColourSample> floor_places(const std::filesystem::path& take, const Rig& rig,
                                              int first_place);

}  // namespace v3d::calibrate
