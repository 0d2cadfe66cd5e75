// What of a scene is seen at a moment: the camera on its way, and the pulse of a take. Pure;
// docs/scene.md has the formulas, tools/viewer/src/scene_clock.ts does the same.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "base/camera_model.h"
#include "v3dctl/scene/scene_file.h"

namespace v3d::ctl {

/// The camera at a moment: cubic curves through the keys, with the slope at a key of the straight
/// line between its neighbours (at an end, of that to its neighbour); still before the first key
/// and after the last. Requires at least one key, rising. at_s of the result is `seconds`.
CameraKey camera_at(std::span<const CameraKey> keys, double seconds);

/// Without distortion, upright.
CameraModel camera_model(const CameraKey& key, ImageSize size);

/// The pulse of a take that is shown; empty where it is hidden. `rate_hz`: its own; `first`,
/// `last`: of its meshes, where the scene names no in or out point. Requires first <= last.
std::optional<int64_t> pulse_at(const SceneTake& take, double rate_hz, int64_t first, int64_t last,
                                double seconds);

}  // namespace v3d::ctl
