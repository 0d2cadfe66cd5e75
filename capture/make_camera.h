// The camera that a studio file asks for.
#pragma once

#include <memory>

#include "base/studio_file.h"
#include "capture/camera.h"

namespace v3d {

/// Does not touch the camera: start() does.
std::unique_ptr<Camera> make_camera(const StudioCamera& settings);

}  // namespace v3d
