// Colour samples of places that several cameras of a take observe: on the surface and on the floor.
#pragma once

#include <filesystem>
#include <vector>

#include "base/geometry/camera_model.h"
#include "calib/colour/colour_fit.h"

namespace v3d::calibrate {

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
/// treats as outliers. Throws InputError where cameras are more than 200 m apart.
std::vector<calib::ColourSample> floor_places(const std::filesystem::path& take, const Rig& rig,
                                              int first_place);

}  // namespace v3d::calibrate
