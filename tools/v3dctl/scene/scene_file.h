// A scene: takes, models and a background composed, and the camera's way through them. The format
// is docs/scene.md; tools/viewer/src/scene_file.ts reads and writes the same.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "base/mesh.h"

namespace v3d::ctl {

/// Where a thing of the scene stands: scaled, turned about x, then y, then z, and moved; world:
/// metres, z up.
struct Placement {
  Eigen::Vector3d move = Eigen::Vector3d::Zero();      ///< metres
  Eigen::Vector3d turn_deg = Eigen::Vector3d::Zero();  ///< about the world's x, y, z
  double scale = 1;                                    ///< above 0

  Eigen::Matrix3d rotation() const;
  Eigen::Affine3d world_from_own() const;
};

/// What a take shows before its in point and after its out point.
enum class Outside : uint8_t { kHold, kHide, kLoop };

struct SceneTake {
  std::filesystem::path take;  ///< its folder
  Placement place;
  double start_s = 0;  ///< when its in point is shown
  double speed = 1;    ///< above 0
  std::optional<int64_t> in_pulse = std::nullopt;
  std::optional<int64_t> out_pulse = std::nullopt;  ///< inclusive
  Outside outside = Outside::kHold;
};

struct SceneModel {
  std::filesystem::path model;  ///< glTF 2.0: .glb or .gltf
  Placement place;
};

/// At most one of image, video and sphere.
struct SceneBackground {
  Rgb8 colour{16, 18, 22};
  std::filesystem::path image;   ///< fills the picture
  std::filesystem::path video;   ///< so does each of its frames, from 0 s on
  std::filesystem::path sphere;  ///< all directions: equirectangular, its middle towards +x
  double turn_deg = 0;           ///< of the sphere, counter-clockwise seen from above
};

struct CameraKey {
  double at_s = 0;
  Eigen::Vector3d eye = Eigen::Vector3d::Zero();
  Eigen::Vector3d look = Eigen::Vector3d::Zero();
  double fov_deg = 40;  ///< of the picture's height
};

struct Scene {
  double rate_hz = 25;  ///< pictures per second
  double seconds = 0;
  SceneBackground background;
  bool floor = false;
  std::vector<SceneTake> takes;
  std::vector<SceneModel> models;
  std::vector<CameraKey> camera;  ///< at least one, rising

  int64_t frames() const;
  double time_of(int64_t frame) const { return static_cast<double>(frame) / rate_hz; }
};

/// `path` is where the text came from: files that the scene names lie relative to its folder.
/// Throws InputError that names the path, the field and what would be right.
Scene parse_scene(std::string_view text, const std::filesystem::path& path);
Scene load_scene(const std::filesystem::path& path);

}  // namespace v3d::ctl
