// The camera that a studio file asks for.
#pragma once

#include <memory>

#include "base/config/studio_file.h"
#include "capture/cameras/camera.h"
#include "capture/sync/pulse_times.h"

namespace v3d {

/// Does not touch the camera: start() does. `pulses` of the node label the frames of a camera that
/// runs free, and outlive it.
std::unique_ptr<Camera> make_camera(const StudioCamera& settings, const PulseTimes& pulses);

}  // namespace v3d
