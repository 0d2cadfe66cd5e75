// The truth of a simulated take: surfaces, points and joints.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "base/geometry/camera_model.h"
#include "sim/performer/performer.h"

namespace v3d::sim {

/// Writes the files that v3d-sim(1) describes under --truth. One caller at a time.
class TakeTruth {
 public:
  /// Creates the folders. `seed`: that of the take.
  TakeTruth(std::filesystem::path folder, Rig rig, std::vector<Performer> cast, uint64_t seed);

  /// Writes the surfaces and points of a pulse, and keeps its joints. `seconds`: time of the
  /// action. Throws std::runtime_error where a file cannot be written.
  void write(int64_t pulse, double seconds);
  /// Writes joints.json with the joints of the pulses so far.
  void write_joints() const;

 private:
  struct PulseJoints {
    int64_t pulse = 0;
    std::vector<Eigen::Vector3d> positions;  ///< of all performers
  };

  std::filesystem::path performer_folder(size_t index) const;

  std::filesystem::path folder_;
  Rig rig_;
  std::vector<Performer> cast_;
  uint64_t seed_;
  bool has_sword_;
  std::optional<SurfacePoints> points_;  ///< chosen at the first pulse
  std::vector<PulseJoints> joints_;
};

}  // namespace v3d::sim
