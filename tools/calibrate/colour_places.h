// Places that several cameras of a take show, and what each makes of their colour.
#pragma once

#include <filesystem>
#include <vector>

#include "base/camera_model.h"
#include "calib/colour/colour_fit.h"

namespace v3d::calibrate {

/// Places on the reconstructed surface, in some frames spread over the take; numbered from
/// `first_place` on. A camera shows a place where it faces it, nothing hides it, and the colours
/// round it are alike and well exposed. `rig`: all cameras of the take. Throws InputError for a
/// take that was not reconstructed.
std::vector<calib::ColourSample> surface_places(const std::filesystem::path& take, const Rig& rig,
                                                int first_place);

/// Places on the floor, z = 0, amid the cameras, as the background plates show them; empty where
/// the take has no plates. What stands on the floor makes some of them wrong: fit_views() finds
/// them out.
std::vector<calib::ColourSample> floor_places(const std::filesystem::path& take, const Rig& rig,
                                              int first_place);

}  // namespace v3d::calibrate
