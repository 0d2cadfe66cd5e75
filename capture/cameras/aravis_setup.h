// Puts a camera's settings into it. For capture/aravis_*.cc only.
#pragma once

#include <arv.h>

#include <string>

#include "base/config/studio_file.h"

namespace v3d::aravis {

/// Writes every setting and reads it back; the camera is at rest then. With `ptp` it returns when
/// the camera's clock is in step. Throws InputError by refuse().
void write_settings(const StudioCamera& settings, ArvCamera* camera);

/// Throws InputError: "camera cam07: Gain (dB): wanted 3.0, got 1.0".
[[noreturn]] void refuse(const StudioCamera& settings, const std::string& feature,
                         const std::string& wanted, const std::string& got);

}  // namespace v3d::aravis
