#include "recon/texture/view_colours.h"

#include <algorithm>
#include <cmath>

namespace v3d::recon {
namespace {

codec::CameraAxis coded_axis(const Eigen::Vector3d& axis) {
  codec::CameraAxis coded;
  for (int n = 0; n < 3; ++n) {
    coded[static_cast<size_t>(n)] = static_cast<int16_t>(std::lround(axis[n] * codec::kAxisUnits));
  }
  return coded;
}

Eigen::Vector3d axis_of(const codec::CameraAxis& axis) {
  return Eigen::Vector3d(axis[0], axis[1], axis[2]).normalized();
}

constexpr auto kFull = static_cast<uint8_t>(Visibility::kFull);

/// Whether a camera has kFull, by vertex.
std::vector<bool> seen_in_full(std::span<const CameraColours> colours) {
  std::vector<bool> is_full;
  for (const CameraColours& camera : colours) {
    is_full.resize(camera.vertices.size());
    for (size_t v = 0; v < is_full.size(); ++v) {
      if (camera.vertices[v][3] == kFull) is_full[v] = true;
    }
  }
  return is_full;
}

}  // namespace

std::vector<codec::CameraView> camera_views(std::span<const CameraColours> colours,
                                            const Rig& rig) {
  const std::vector<bool> is_full = seen_in_full(colours);
  std::vector<codec::CameraView> views;
  for (const CameraColours& camera : colours) {
    const auto index = static_cast<size_t>(find_camera(rig, camera.camera));
    codec::CameraView& view = views.emplace_back();
    view.axis = coded_axis(rig[index].model.viewing_direction());
    view.vertices = camera.vertices;
    for (size_t v = 0; v < view.vertices.size(); ++v) {
      auto& vertex = view.vertices[v];
      if (vertex[3] == kFull || (vertex[3] != 0 && !is_full[v])) {
        vertex[3] = kFull;
      } else {
        vertex = {};
      }
    }
  }
  return views;
}

std::vector<Rgb8> blended_views(std::span<const Rgb8> colours,
                                std::span<const codec::CameraView> views,
                                const ViewDependence& eye) {
  std::vector<Eigen::Vector4f> sums(colours.size(), Eigen::Vector4f::Zero());
  for (const codec::CameraView& view : views) {
    const float weight = blending_weight(axis_of(view.axis), eye);
    for (size_t v = 0; v < sums.size(); ++v) {
      const auto& [r, g, b, seen] = view.vertices[v];
      if (seen != 0) sums[v] += weight * Eigen::Vector4f(r, g, b, 1);
    }
  }
  std::vector<Rgb8> blended(colours.begin(), colours.end());
  for (size_t v = 0; v < sums.size(); ++v) {
    if (sums[v][3] > 0) blended[v] = rounded_colour(sums[v].head<3>() / sums[v][3]);
  }
  return blended;
}

}  // namespace v3d::recon
