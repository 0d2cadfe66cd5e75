// Writes a simulated take without daemons.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/geometry/camera_model.h"
#include "sim/cameras/exposure_record.h"
#include "sim/performer/performer.h"

namespace v3d::sim {

// The truth of a simulated take: surfaces, points and joints.

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

// Fault scripts for simulated takes and studios.

/// Reads a TOML file with [[fault]] tables: camera = "cam03", pulse = 12, kind = "drop", and the
/// fields of the kind (see v3d-sim(1)).
///
/// `take_pulses`: number of pulses of a take that is written without daemons, which supports drop,
/// duplicate, black, suspect and late; empty for a studio, which supports all kinds but the last
/// two. Throws InputError with file, line and field for unknown cameras, pulses outside the take,
/// unknown or unsupported kinds, missing or invalid values, and two faults of a camera at one
/// pulse.
std::vector<Fault> load_faults(const std::filesystem::path& path, const Rig& rig,
                               std::optional<int64_t> take_pulses);
std::vector<Fault> parse_faults(std::string_view text, const std::filesystem::path& path,
                                const Rig& rig, std::optional<int64_t> take_pulses);

/// Whether `faults` contains this fault.
bool has_fault(const std::vector<Fault>& faults, const std::string& camera, int64_t pulse,
               FaultKind kind);

/// The faults of one camera with pulses converted to edge numbers of the cable. Pulse 0 of the
/// script is the first edge after `empty_pulses`.
std::vector<Fault> faults_at_edges(const std::vector<Fault>& faults, const std::string& camera,
                                   int64_t empty_pulses);

struct SimulatedTake {
  std::filesystem::path folder;  ///< created; its name is the take's
  Rig rig;
  int64_t frames = 0;
  double rate_hz = 25;
  double begin_s = 0;  ///< time of the action at pulse 0
  uint64_t seed = 1;
  double colour_spread = 0;  ///< RenderOptions::colour_spread
  std::vector<Performer> cast = {Performer{}};
  std::vector<Fault> faults;
  // The frames have masks if one of these is not 0.
  double outline_noise_px = 0;  ///< standard deviation of the noise of outlines
  int mask_dilation_px = 0;     ///< pixels of the room on every side of a mask
  /// Folder for the truth (TakeTruth).
  std::optional<std::filesystem::path> truth;
};

/// Writes the take. The middle of the exposure of pulse k is at begin_s + k / rate_hz seconds of
/// the action.
///
/// Deterministic. `progress` is called with the number of finished pulses. Throws InputError for a
/// folder that is not empty and for an invalid take name, std::runtime_error for write errors.
void write_take(const SimulatedTake& take, const std::function<void(int64_t)>& progress);

}  // namespace v3d::sim
