// Writes the studio file's settings to a camera. For capture/cameras/aravis_*.cc only.
#pragma once

#include <arv.h>

#include <string>

#include "base/config/studio_file.h"

namespace v3d::aravis {

/// Stops acquisition, writes every setting and reads it back. With `ptp` it waits until the
/// camera's clock is synchronised, at most 20 s. Throws InputError (see refuse()) if a value
/// differs.
void write_settings(const StudioCamera& settings, ArvCamera* camera);

/// Throws InputError such as "camera cam07: Gain (dB): wanted 3.0, got 1.0".
[[noreturn]] void refuse(const StudioCamera& settings, const std::string& feature,
                         const std::string& wanted, const std::string& got);

}  // namespace v3d::aravis
