// A take on disk: a folder (see docs/takes.md).
//   take.toml  ledger.toml  calib.toml  studio.toml  pulses.lcmlog  <camera>.lcmlog  background/
//   mesh.v3d  slate.toml  verified.toml
//   after a restart in the take: <camera>.0001.lcmlog, ... and <camera>.lcmlog.index, ...
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/geometry/camera_model.h"
#include "base/io/result.h"

namespace v3d {

/// More pulses than any take has (four days at 25 Hz): a larger count or number comes from a
/// damaged file, and nobody shall list that many missing frames.
inline constexpr int64_t kMaxPulses = 10'000'000;

enum class TakeState { kRecording, kComplete, kRecovered };
std::string_view name(TakeState state);

/// take.toml
struct TakeInfo {
  std::string name;
  std::string studio;
  double rate_hz = 0;
  int64_t pulses = 0;  ///< commanded; known once the take has ended
  TakeState state = TakeState::kRecording;
  std::string software_version;
  RealtimeInstant started;
  std::vector<std::string> cameras;
};

/// The names of things inside a take folder.
struct TakePaths {
  std::filesystem::path folder;
  std::filesystem::path info() const { return folder / "take.toml"; }
  std::filesystem::path ledger() const { return folder / "ledger.toml"; }
  std::filesystem::path calib() const { return folder / "calib.toml"; }
  /// The studio file as it was; absent in takes that come from elsewhere.
  std::filesystem::path studio() const { return folder / "studio.toml"; }
  /// The first segment of the log, as frames() is (take/logs/log_segments.h).
  std::filesystem::path pulses() const { return folder / "pulses.lcmlog"; }
  std::filesystem::path frames(const std::string& camera) const {
    return folder / (camera + ".lcmlog");
  }
  std::filesystem::path background() const { return folder / "background"; }
  std::filesystem::path mesh() const { return folder / "mesh.v3d"; }
  /// What the crew says of it; absent until somebody does.
  std::filesystem::path slate() const { return folder / "slate.toml"; }
  /// Holds room for the ledger while the take is recorded.
  std::filesystem::path reserve() const { return folder / ".reserve"; }
  /// Written by a verification; absent before.
  std::filesystem::path verified() const { return folder / "verified.toml"; }
};

/// Throws InputError when the folder is no take, with what is missing.
TakeInfo load_take_info(const TakePaths& paths);
/// The rig as it was when the take was recorded: load_calib() of a take, by read_take_file().
Rig load_take_calib(const TakePaths& paths);
/// The studio as it was: load_studio() of a take, by read_take_file(). Empty where the take has
/// none.
std::optional<Studio> load_take_studio(const TakePaths& paths);
TakeInfo parse_take_info(std::string_view text, const std::filesystem::path& path);
/// The content of take.toml.
std::string take_info_text(const TakeInfo& info);
/// io::replace_file() of take.toml.
[[nodiscard]] io::Status save_take_info(const TakePaths& paths, const TakeInfo& info);

}  // namespace v3d
