// Surfaces and observations for tests of the tracker.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

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

inline TrackingOptions small_options() {
  TrackingOptions options;
  options.triangles = 3000;
  options.node_spacing_m = 0.06;
  return options;
}

}  // namespace v3d::recon
