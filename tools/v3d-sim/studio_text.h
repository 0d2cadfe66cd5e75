// The studio file of a simulated studio.
#pragma once

#include <string>

#include "base/geometry/camera_model.h"

namespace v3d::sim {

struct StudioText {
  double rate_hz = 25;
  double voxel_m = 0.01;
};

/// The text of studio.toml for the fake cameras of `rig`, as load_studio() reads it. Cameras and
/// trigger belong to node cap01; recon01 is the reconstruction node.
std::string studio_text(const Rig& rig, const StudioText& options);

}  // namespace v3d::sim
