// Finds a camera on the network or the bus and takes control of it. For capture/aravis_*.cc only.
#pragma once

#include "base/config/studio_file.h"
#include "capture/cameras/aravis_object.h"

namespace v3d::aravis {

/// By `settings.address`: an IPv4 address, or else a serial number. Any thread; searches one at a
/// time. Throws InputError that names the camera and what was found in its place.
Owned<ArvCamera> open(const StudioCamera& settings);

}  // namespace v3d::aravis
