// Surfaces and observations for tests of the tracker.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "recon/motion/segment_tracker.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"

namespace v3d::recon {

/// A body of 1 m that bends sideways and moves, at a pulse. The vertices of all pulses correspond.
inline Mesh body_at(int pulse, float bend_per_pulse = 0.02F) {
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.15F, 40);
  const float bend = bend_per_pulse * static_cast<float>(pulse);
  for (Eigen::Vector3f& p : mesh.vertices) {
    p.z() *= 3.3F;
    // A flattened and dented body: its shape shows how it turns.
    p.x() *= 0.6F + 0.3F * std::sin(9 * p.z());
    const float upper = std::max(0.0F, p.z());
    p.y() += bend * upper * upper * 4;
    p += Eigen::Vector3f(0.01F, 0.004F, 0) * static_cast<float>(pulse);
  }
  return mesh;
}

inline std::shared_ptr<const ObservedPulse> pulse_with(int pulse, Mesh surface) {
  auto observed = std::make_shared<ObservedPulse>();
  observed->pulse = pulse;
  observed->surface = std::move(surface);
  return observed;
}

/// Two cameras on the side of +x, or of -x for -1.
inline std::array<CameraModel, 2> two_models(double side = 1) {
  return {shapes::camera({2 * side, 0, 0}, {0, 0, 0}, {200, 150}, 250),
          shapes::camera({1.4 * side, 1.4 * side, 0}, {0, 0, 0}, {200, 150}, 250)};
}

/// With the images of two cameras, which show `pictured`.
inline std::shared_ptr<const ObservedPulse> pulse_with_images(
    int pulse, Mesh surface, const std::array<CameraModel, 2>& models, const Mesh& pictured) {
  auto observed = std::make_shared<ObservedPulse>();
  observed->pulse = pulse;
  for (const CameraModel& model : models) {
    observed->frames.frames.push_back(
        observe("cam", {}, draw_mesh(pictured, model).view(), draw_silhouette(pictured, model)));
  }
  const std::array<DeformCamera, 2> cameras{
      {{&models[0], &observed->frames.frames[0]}, {&models[1], &observed->frames.frames[1]}}};
  observed->cameras = SurfaceCameras(cameras, surface, 0.01);
  observed->surface = std::move(surface);
  return observed;
}

inline std::shared_ptr<const ObservedPulse> pulse_with_images(
    int pulse, const Mesh& surface, const std::array<CameraModel, 2>& models) {
  return pulse_with_images(pulse, surface, models, surface);
}

/// An upright body without hollows, 0.6 m wide.
inline Mesh egg() {
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.3F, 40);
  for (Eigen::Vector3f& p : mesh.vertices) p = {p.x(), 0.8F * p.y(), 1.3F * p.z()};
  return mesh;
}

/// With a bump of `height_m`, 10 cm wide, around (-0.3, 0, 0).
inline Mesh with_bump(Mesh mesh, float height_m) {
  for (Eigen::Vector3f& p : mesh.vertices) {
    if (p.x() > 0) continue;
    p.x() -= height_m * std::exp(-p.tail<2>().squaredNorm() / (2 * 0.04F * 0.04F));
  }
  return mesh;
}

/// A ball around the origin with a pattern, which turned by `angle` around the vertical axis. Its
/// shape does not show the turn.
inline Mesh patterned_ball(float angle) {
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.3F, 120);
  const Eigen::AngleAxisf back(-angle, Eigen::Vector3f::UnitZ());
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    const Eigen::Vector3f p = back * vertex;
    const float wave = std::sin(90 * p.x() + 2 * std::sin(31 * p.y())) *
                           std::sin(83 * p.y() + 3 * std::sin(27 * p.z())) +
                       0.7F * std::sin(71 * p.z() + 2 * std::sin(43 * p.x()));
    const auto grey = static_cast<uint8_t>(std::clamp(128 + 60 * wave, 0.0F, 255.0F));
    mesh.colours.push_back({grey, grey, grey});
  }
  return mesh;
}

/// Cameras on four sides.
inline std::vector<CameraModel> four_models() {
  std::vector<CameraModel> models;
  for (int i = 0; i < 4; ++i) {
    const double bearing = 0.5 * std::numbers::pi * i + 0.3;
    models.push_back(shapes::camera({2 * std::cos(bearing), 2 * std::sin(bearing), 0.2}, {0, 0, 0},
                                    {400, 300}, 500));
  }
  return models;
}

/// The ball with images that show `pictured`.
inline std::shared_ptr<const ObservedPulse> pulse_of_ball(int pulse, const Mesh& pictured,
                                                          const std::vector<CameraModel>& models) {
  auto observed = std::make_shared<ObservedPulse>();
  observed->pulse = pulse;
  observed->surface = shapes::sphere({0, 0, 0}, 0.3F, 40);
  for (const CameraModel& model : models) {
    observed->frames.frames.push_back(
        observe("cam", {}, draw_mesh(pictured, model).view(), draw_silhouette(pictured, model)));
  }
  std::vector<DeformCamera> cameras;
  for (size_t c = 0; c < models.size(); ++c) {
    cameras.push_back({&models[c], &observed->frames.frames[c]});
  }
  observed->cameras = SurfaceCameras(cameras, observed->surface, 0.005);
  return observed;
}

inline TrackingOptions small_options() {
  TrackingOptions options;
  options.triangles = 3000;
  options.node_spacing_m = 0.06;
  return options;
}

}  // namespace v3d::recon
