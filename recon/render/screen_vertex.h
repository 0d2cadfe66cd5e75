// Projection of the vertices of a mesh into a camera.
#pragma once

#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"

namespace v3d {

/// Distance of the near plane, metres. Nothing nearer is drawn, so that a mesh around a camera does
/// no harm.
inline constexpr double kNearPlaneMetres = 0.05;

/// x and y are pixels with (0, 0) in the centre of the first pixel, also outside the image.
struct ScreenVertex {
  float x = 0, y = 0;
  float z = 0;          ///< along the optical axis, metres; valid also where !on_screen()
  float inverse_z = 0;  ///< 1 / z where on_screen(), else 0

  /// In front of the near plane and inside the lens model: x and y are valid.
  bool on_screen() const { return inverse_z > 0; }
};

/// Projects every vertex through the whole lens model in single precision, within 0.02 pixels of
/// CameraModel::project() from 0.2 m on. In the order of the mesh. One thread; every instruction
/// set gives the same bits. `screen` keeps its memory.
void project_vertices(const Mesh& mesh, const CameraModel& camera,
                      std::vector<ScreenVertex>& screen);
std::vector<ScreenVertex> project_vertices(const Mesh& mesh, const CameraModel& camera);

}  // namespace v3d
