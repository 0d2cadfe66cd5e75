// Device discovery with Aravis: finds and opens a camera. For capture/cameras/aravis_*.cc only.
#pragma once

#include "base/config/studio_file.h"
#include "capture/cameras/aravis_object.h"

namespace v3d::aravis {

/// Opens the camera that `settings.address` names: an IPv4 address, otherwise a serial number.
///
/// Throws InputError with the name of the camera and the serial numbers that were found.
/// Thread-safe; only one search runs at a time.
Owned<ArvCamera> open(const StudioCamera& settings);

}  // namespace v3d::aravis
