// The background model of a camera as a take has it.
#pragma once

#include <optional>
#include <string>

#include "capture/segmentation/background.h"
#include "take/take.h"

namespace v3d {

/// The background model of `camera`; empty where the take has none. Throws InputError as
/// load_background() does, and where the take's folder `background` is a symbolic link.
std::optional<BackgroundModel> load_take_background(const TakePaths& paths,
                                                    const std::string& camera);

}  // namespace v3d
