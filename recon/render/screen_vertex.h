// The vertices of a mesh as a camera sees them.
#pragma once

#include <vector>

#include "base/camera_model.h"
#include "base/mesh.h"

namespace v3d {

/// Nothing nearer than this to a camera is drawn: a mesh round a camera does no harm.
inline constexpr double kNearPlaneMetres = 0.05;

/// x and y are pixels (centre of the first pixel: 0, 0), also outside the image.
struct ScreenVertex {
  float x = 0, y = 0;
  float z = 0;          ///< along the optical axis, metres; right also where !on_screen()
  float inverse_z = 0;  ///< 1 / z where on_screen(), else 0

  /// In front of the near plane and inside the lens model: x and y are right.
  bool on_screen() const { return inverse_z > 0; }
};

/// The whole lens model at every vertex, in single precision: within 0.02 pixels of
/// CameraModel::project() from 0.2 m before the camera. In the order of the mesh; one thread; the
/// same bits on every processor. `screen` keeps its memory.
void project_vertices(const Mesh& mesh, const CameraModel& camera,
                      std::vector<ScreenVertex>& screen);
std::vector<ScreenVertex> project_vertices(const Mesh& mesh, const CameraModel& camera);

}  // namespace v3d
