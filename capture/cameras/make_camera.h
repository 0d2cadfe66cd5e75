// Factory of cameras: selects the backend by the studio file.
#pragma once

#include <memory>

#include "base/config/studio_file.h"
#include "capture/cameras/camera.h"
#include "capture/sync/pulse_times.h"

namespace v3d {

/// Creates the camera object without accessing the device; start() opens it. `pulses`, the pulses
/// of this node, label the frames of a free-running camera and must outlive it.
std::unique_ptr<Camera> make_camera(const StudioCamera& settings, const PulseTimes& pulses);

}  // namespace v3d
