// Scene: its file, and its state at a time.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"

namespace v3d::ctl {

// Scene: takes, models and a background in one world, and a camera path.
// The format is in docs/scene.md; tools/viewer/src/scene_file.ts reads and writes it, too.

/// Pose and scale of an object in the world (metres, z up): scaled, rotated about x, then y, then
/// z, and translated.
struct Placement {
  Eigen::Vector3d move = Eigen::Vector3d::Zero();      ///< metres
  Eigen::Vector3d turn_deg = Eigen::Vector3d::Zero();  ///< about the axes of the world
  double scale = 1;                                    ///< above 0

  Eigen::Matrix3d rotation() const;
  Eigen::Affine3d world_from_own() const;
};

/// What a take shows before its in point and after its out point.
enum class Outside : uint8_t { kHold, kHide, kLoop };

struct SceneTake {
  std::filesystem::path take = {};  ///< folder
  Placement place = {};
  double start_s = 0;  ///< scene time of its in point
  double speed = 1;    ///< above 0
  std::optional<int64_t> in_pulse = std::nullopt;
  std::optional<int64_t> out_pulse = std::nullopt;  ///< inclusive
  Outside outside = Outside::kHold;
  std::optional<int> performer = std::nullopt;  ///< the only one that is shown
  bool sound = true;                            ///< whether its sound is played
  double sound_shift_s = 0;                     ///< sound is later by this, in scene time
  double sound_gain_db = 0;
};

struct SceneModel {
  std::filesystem::path model;  ///< glTF 2.0: .glb or .gltf
  Placement place;
};

/// Has at most one of image, video and sphere.
struct SceneBackground {
  Rgb8 colour{16, 18, 22};
  std::filesystem::path image;   ///< fills the picture
  std::filesystem::path video;   ///< each frame fills the picture; starts at 0 s
  std::filesystem::path sphere;  ///< equirectangular panorama, its centre towards +x
  double turn_deg = 0;           ///< of the sphere, counter-clockwise seen from above
};

struct CameraKey {
  double at_s = 0;
  Eigen::Vector3d eye = Eigen::Vector3d::Zero();   ///< camera centre, metres
  Eigen::Vector3d look = Eigen::Vector3d::Zero();  ///< point in the middle of the image, metres
  double fov_deg = 40;                             ///< vertical
};

struct Scene {
  double rate_hz = 25;  ///< pictures per second
  double seconds = 0;
  SceneBackground background;
  bool floor = false;
  std::vector<SceneTake> takes;
  std::vector<SceneModel> models;
  std::vector<CameraKey> camera;  ///< at least one, with increasing times

  int64_t frames() const;
  double time_of(int64_t frame) const { return static_cast<double>(frame) / rate_hz; }
};

/// Parses a scene. `path`: origin of the text; the files of the scene are relative to its folder.
/// Throws InputError with the path, the field and what is expected.
Scene parse_scene(std::string_view text, const std::filesystem::path& path);
Scene load_scene(const std::filesystem::path& path);

// State of a scene at a time: camera on its path, and pulses of the takes. Pure.
// tools/viewer/src/scene_clock.ts does the same. Source of the formulas: docs/scene.md.

/// Camera at a time: a cubic Hermite spline through the keys. The slope at a key is that of the
/// line between its neighbours, at an end of the line to its neighbour. The camera does not move
/// before the first key and after the last. Requires at least one key, with increasing times. at_s
/// of the result is `seconds`.
CameraKey camera_at(std::span<const CameraKey> keys, double seconds);

/// Camera model without distortion, upright.
CameraModel camera_model(const CameraKey& key, ImageSize size);

/// The pulses of a take that a scene shows.
struct TakePart {
  int64_t in = 0;
  int64_t length = 1;
};
/// `first`, `last`: pulses of its meshes, used without an in or out point. Requires first <= last.
TakePart part_of(const SceneTake& take, int64_t first, int64_t last);

/// Pulse of a take that is shown at a time; empty where the take is hidden. `rate_hz`: pulse rate
/// of the take. `first`, `last`: as for part_of().
std::optional<int64_t> pulse_at(const SceneTake& take, double rate_hz, int64_t first, int64_t last,
                                double seconds);

}  // namespace v3d::ctl
