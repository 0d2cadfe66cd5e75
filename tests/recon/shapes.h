// Meshes with known properties, for tests.
#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"

namespace v3d::recon::shapes {

/// A closed box, outward triangles.
inline Mesh box(const Eigen::Vector3f& low, const Eigen::Vector3f& high) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.emplace_back(i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(),
                               i & 4 ? high.z() : low.z());
  }
  constexpr uint32_t kQuads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                     {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& q : kQuads) {
    mesh.triangles.push_back({q[0], q[1], q[2]});
    mesh.triangles.push_back({q[0], q[2], q[3]});
  }
  return mesh;
}

/// A closed sphere of `rings` rings of 2 * rings quads.
inline Mesh sphere(const Eigen::Vector3f& centre, float radius, int rings) {
  Mesh mesh;
  const int columns = 2 * rings;
  mesh.vertices.push_back(centre + Eigen::Vector3f(0, 0, radius));
  for (int i = 1; i < rings; ++i) {
    const double theta = std::numbers::pi * i / rings;
    for (int j = 0; j < columns; ++j) {
      const double phi = 2 * std::numbers::pi * j / columns;
      mesh.vertices.push_back(centre + radius * Eigen::Vector3d(std::sin(theta) * std::cos(phi),
                                                                std::sin(theta) * std::sin(phi),
                                                                std::cos(theta))
                                                    .cast<float>());
    }
  }
  mesh.vertices.push_back(centre - Eigen::Vector3f(0, 0, radius));
  const auto at = [&](int i, int j) -> uint32_t {
    if (i == 0) {
      return 0;
    }
    return i == rings ? static_cast<uint32_t>(mesh.vertices.size() - 1)
                      : static_cast<uint32_t>(1 + (i - 1) * columns + j % columns);
  };
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < columns; ++j) {
      if (i > 0) {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
      }
      if (i + 1 < rings) {
        mesh.triangles.push_back({at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)});
      }
    }
  }
  return mesh;
}

/// A flat square patch at z = height, facing +z, of n x n quads.
inline Mesh patch(float half_side, float height, int n) {
  Mesh mesh;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      mesh.vertices.emplace_back(half_side * (2.0F * i / n - 1), half_side * (2.0F * j / n - 1),
                                 height);
    }
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const auto a = static_cast<uint32_t>(j * (n + 1) + i);
      const auto b = a + n + 1;
      mesh.triangles.push_back({a, a + 1, b});
      mesh.triangles.push_back({a + 1, b + 1, b});
    }
  }
  return mesh;
}

inline void append(Mesh& mesh, const Mesh& other) {
  const auto base = static_cast<uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), other.vertices.begin(), other.vertices.end());
  mesh.colours.insert(mesh.colours.end(), other.colours.begin(), other.colours.end());
  for (const auto& t : other.triangles) {
    mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  }
}

/// A camera without distortion, its principal point in the middle of the image.
inline CameraModel camera(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, ImageSize size,
                          double focal, const Distortion& distortion = {}) {
  Eigen::Matrix3d matrix;
  matrix << focal, 0, 0.5 * (size.width - 1), 0, focal, 0.5 * (size.height - 1), 0, 0, 1;
  return {size, matrix, distortion, look_at(eye, target)};
}

}  // namespace v3d::recon::shapes
