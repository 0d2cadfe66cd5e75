// Batch rendering: the images of all cameras of a rig, in parallel on all cores.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "sim/rendering/renderer.h"

namespace v3d::sim {

/// Renderers of all cameras of a rig. Threads: one caller at a time.
class BatchRenderer {
 public:
  /// Renders the empty studio for each camera.
  BatchRenderer(const Rig& rig, const RenderOptions& options);

  /// One image per camera, in the order of the rig. `seconds`: time of the middle of the exposure,
  /// or nothing for the empty studio. `exposure_number` seeds the noise.
  std::vector<Image> render_all(std::optional<double> seconds, uint64_t exposure_number);

 private:
  RenderOptions options_;
  std::vector<std::unique_ptr<CameraRenderer>> cameras_;
};

}  // namespace v3d::sim
