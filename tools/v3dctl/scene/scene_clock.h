// State of a scene at a time: camera on its path, and pulses of the takes. Pure.
// tools/viewer/src/scene_clock.ts does the same. Source of the formulas: docs/scene.md.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "base/geometry/camera_model.h"
#include "v3dctl/scene/scene_file.h"

namespace v3d::ctl {

/// Camera at a time: a cubic Hermite spline through the keys. The slope at a key is that of the
/// line between its neighbours, at an end of the line to its neighbour. The camera does not move
/// before the first key and after the last. Requires at least one key, with increasing times. at_s
/// of the result is `seconds`.
CameraKey camera_at(std::span<const CameraKey> keys, double seconds);

/// Camera model without distortion, upright.
CameraModel camera_model(const CameraKey& key, ImageSize size);

/// Pulse of a take that is shown at a time; empty where the take is hidden. `rate_hz`: pulse rate
/// of the take. `first`, `last`: pulses of its meshes, used without an in or out point. Requires
/// first <= last.
std::optional<int64_t> pulse_at(const SceneTake& take, double rate_hz, int64_t first, int64_t last,
                                double seconds);

}  // namespace v3d::ctl
