#include "v3d-sim/take_truth.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/io/file.h"
#include "common/mesh_file.h"
#include "sim/performer/skeleton.h"
#include "sim/rendering/camera_images.h"

namespace v3d::sim {
namespace {

using nlohmann::ordered_json;

void append_surface(Mesh& all, const Mesh& more) {
  const auto first = static_cast<uint32_t>(all.vertices.size());
  all.vertices.insert(all.vertices.end(), more.vertices.begin(), more.vertices.end());
  for (const auto& t : more.triangles) {
    all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
}

/// A point of the surface counts as seen up to this distance behind the nearest surface.
constexpr double kSeenToleranceM = 0.006;
constexpr size_t kTruePoints = 20'000;

/// The points as vertices; their colours state cameras and group (v3d-sim(1)).
Mesh point_cloud(const SurfacePoints& points, const Rig& rig, const std::vector<Part>& parts) {
  Mesh cloud;
  cloud.vertices = points.positions(parts);
  const std::vector<uint8_t> cameras =
      cameras_that_see(rig, parts, cloud.vertices, kSeenToleranceM);
  for (size_t i = 0; i < cameras.size(); ++i) {
    cloud.colours.push_back({cameras[i], static_cast<uint8_t>(points.groups()[i]), 0});
  }
  return cloud;
}

ordered_json to_json(const Joint& joint, int first) {
  ordered_json object = {{"name", joint.name},
                         {"parent", joint.parent < 0 ? -1 : first + joint.parent}};
  if (!joint.main.empty()) object["main"] = joint.main;
  return object;
}

/// Metres, rounded to micrometres.
ordered_json to_json(const std::vector<Eigen::Vector3d>& positions) {
  auto list = ordered_json::array();
  const auto rounded = [](double metres) { return std::round(1e6 * metres) / 1e6; };
  for (const Eigen::Vector3d& p : positions) {
    list.push_back({rounded(p.x()), rounded(p.y()), rounded(p.z())});
  }
  return list;
}

}  // namespace

TakeTruth::TakeTruth(std::filesystem::path folder, Rig rig, std::vector<Performer> cast,
                     uint64_t seed)
    : folder_(std::move(folder)),
      rig_(std::move(rig)),
      cast_(std::move(cast)),
      seed_(seed),
      has_sword_(std::ranges::any_of(cast_, [](const Performer& p) { return !p.model; })) {
  std::filesystem::create_directories(folder_ / "points");
  if (has_sword_) std::filesystem::create_directory(folder_ / "sword");
  for (size_t i = 0; cast_.size() > 1 && i < cast_.size(); ++i) {
    std::filesystem::create_directory(performer_folder(i));
  }
}

std::filesystem::path TakeTruth::performer_folder(size_t index) const {
  return folder_ / fmt::format("performer{}", index + 1);
}

void TakeTruth::write(int64_t pulse, double seconds) {
  const std::string name = fmt::format("{:06}.ply", pulse);
  std::vector<Part> all;
  Mesh blades;
  PulseJoints& joints = joints_.emplace_back();
  joints.pulse = pulse;
  for (size_t i = 0; i < cast_.size(); ++i) {
    const std::vector<Part> parts = performer_parts(seconds, seed_, cast_[i]);
    if (cast_.size() > 1) write_ply(performer_folder(i) / name, outer_surface(parts, seed_));
    all.insert(all.end(), parts.begin(), parts.end());
    append_surface(blades, sword_blade(seconds, cast_[i]).mesh);
    const std::vector<Eigen::Vector3d> own = joint_positions(seconds, cast_[i]);
    joints.positions.insert(joints.positions.end(), own.begin(), own.end());
  }
  write_ply(folder_ / name, outer_surface(all, seed_));
  if (has_sword_) write_ply(folder_ / "sword" / name, blades);
  if (!points_) points_.emplace(all, kTruePoints, seed_);
  write_ply(folder_ / "points" / name, point_cloud(*points_, rig_, all));
}

void TakeTruth::write_joints() const {
  auto joints = ordered_json::array(), pulses = ordered_json::array();
  for (size_t i = 0; i < cast_.size(); ++i) {
    const auto first = static_cast<int>(joints.size());
    for (const Joint& joint : joints_of(cast_[i])) {
      joints.push_back(to_json(joint, first));
      if (cast_.size() > 1) joints.back()["performer"] = i + 1;
    }
  }
  for (const PulseJoints& pulse : joints_) {
    pulses.push_back({{"pulse", pulse.pulse}, {"positions", to_json(pulse.positions)}});
  }
  const ordered_json file = {{"joints", std::move(joints)}, {"pulses", std::move(pulses)}};
  // Names in a file can be invalid UTF-8.
  io::throw_if_failed(
      io::replace_file(folder_ / "joints.json",
                       file.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n"));
}

}  // namespace v3d::sim
