// Many images of many cameras, rendered on all cores.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "sim/renderer.h"

namespace v3d::sim {

/// All cameras of a rig. One caller at a time.
class Film {
 public:
  /// Draws every camera's empty room.
  Film(const Rig& rig, const RenderOptions& options);

  /// One image per camera, in the rig's order: the performer at `seconds` (the middle of the
  /// exposure), or the empty studio. `exposure_number` seeds the noise.
  std::vector<Image> shoot_all(std::optional<double> seconds, uint64_t exposure_number);

 private:
  RenderOptions options_;
  std::vector<std::unique_ptr<CameraRenderer>> cameras_;
};

}  // namespace v3d::sim
