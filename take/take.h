// A take on disk: its files, its nodes, ranges of its frames.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/config/studio_file.h"
#include "base/config/toml_file.h"
#include "base/core/time.h"
#include "base/geometry/camera_model.h"
#include "base/io/file.h"

namespace v3d::take {

// A take on disk: the files of its folder and its description, take.toml (docs/takes.md).
//   take.toml  ledger.toml  calib.toml  studio.toml  pulses.lcmlog  <camera>.lcmlog  background/
//   sound/<node>.wav  mesh.v3d  proxy.v3d  repaired.<node>.txt  slate.toml  verified.toml
//   after a restart in the take: <camera>.0001.lcmlog, ... and <camera>.lcmlog.index, ...,
//   sound/<node>.0001.wav, ...

/// Limit of pulse counts and pulse numbers: four days at 25 Hz. A larger value comes from a damaged
/// file. The limit keeps lists of missing frames short enough for memory.
inline constexpr int64_t kMaxPulses = 10'000'000;

enum class TakeState { kRecording, kComplete, kRecovered };
std::string_view name(TakeState state);

/// The content of take.toml.
struct TakeInfo {
  std::string name;
  std::string studio;
  double rate_hz = 0;
  int64_t pulses = 0;  ///< commanded; known after the end of the take
  TakeState state = TakeState::kRecording;
  std::string software_version;
  RealtimeInstant started;
  std::vector<std::string> cameras;
};

/// Paths of the files in a take folder.
struct TakePaths {
  std::filesystem::path folder;
  std::filesystem::path info() const { return folder / "take.toml"; }
  std::filesystem::path ledger() const { return folder / "ledger.toml"; }
  std::filesystem::path calib() const { return folder / "calib.toml"; }
  /// The studio file at the time of the recording. Imported takes have none.
  std::filesystem::path studio() const { return folder / "studio.toml"; }
  /// The first segment of the log, as is frames() (take/logs/log_files.h).
  std::filesystem::path pulses() const { return folder / "pulses.lcmlog"; }
  std::filesystem::path frames(const std::string& camera) const {
    return folder / (camera + ".lcmlog");
  }
  std::filesystem::path background() const { return folder / "background"; }
  /// Sound of the nodes: <node>.wav; after a restart in the take also <node>.0001.wav, ...
  std::filesystem::path sound() const { return folder / "sound"; }
  std::filesystem::path mesh() const { return folder / "mesh.v3d"; }
  /// The pulses of mesh.v3d with coarser voxels, for previews. Absent unless requested.
  std::filesystem::path proxy() const { return folder / "proxy.v3d"; }
  std::filesystem::path motion() const { return folder / "motion.v3d"; }
  /// Tracked surfaces of meshes that v3dctl reconstruct has replaced, numbered from 1
  /// (is_earlier_motion()).
  std::filesystem::path earlier_motion(int number) const {
    return folder / ("motion.earlier-" + std::to_string(number) + ".v3d");
  }
  /// The operations of an edited take (docs/editing.md). Recordings have none.
  std::filesystem::path edit() const { return folder / "edit.json"; }
  /// The crew's notes. Absent until the first note.
  std::filesystem::path slate() const { return folder / "slate.toml"; }
  /// Reserves disk space for the ledger during the recording.
  std::filesystem::path reserve() const { return folder / ".reserve"; }
  /// The result of the last verification. Absent before the first one.
  std::filesystem::path verified() const { return folder / "verified.toml"; }
};

/// The entries of a folder of takes, sorted by name, without hidden ones: locks, unfinished
/// collections and interrupted deletions are no takes. Nor is lost+found, which only root can read.
/// Fails with path and cause.
[[nodiscard]] io::Result<std::vector<std::filesystem::path>> list_take_folders(
    const std::filesystem::path& takes);

/// True when the folder has a log of a camera or of the pulses. False when it does not exist, or is
/// no folder. Fails with path and cause.
[[nodiscard]] io::Result<bool> holds_logs(const std::filesystem::path& folder);
/// What is wrong with a folder that has logs and no take.toml. The name of a folder that an
/// interrupted import has left differs from that of a take: "kendo-07.partial-Ab12Cd".
std::string missing_info_text(const std::filesystem::path& folder);

/// Reads take.toml. Throws InputError when the folder or take.toml is missing, and with file, line
/// and field when take.toml is invalid.
TakeInfo load_take_info(const TakePaths& paths);
/// Is this a take that v3dctl edit made? It has a tracked surface and no recording, so no ledger.
bool is_edited(const TakePaths& paths);
/// The calibration at the time of the recording. Reads calib.toml with read_take_text() and parses
/// it as load_calib() does.
Rig load_take_calib(const TakePaths& paths);
/// The studio file at the time of the recording. Reads studio.toml with read_take_text() and parses
/// it with parse_recorded_studio(). Empty when the take has none.
std::optional<Studio> load_take_studio(const TakePaths& paths);
TakeInfo parse_take_info(std::string_view text, const std::filesystem::path& path);
/// The content of take.toml.
std::string take_info_text(const TakeInfo& info);
/// Writes take.toml with io::replace_file().
[[nodiscard]] io::Status save_take_info(const TakePaths& paths, const TakeInfo& info);

// The capture nodes of a take, from the studio file at the time of the recording.

/// A capture node of a take, with its cameras in the studio file. A camera may have been missing in
/// the take (arm --allow-missing).
struct TakeNode {
  std::string name;
  std::vector<std::string> cameras;
  friend bool operator==(const TakeNode&, const TakeNode&) = default;
};

/// All capture nodes of a take, sorted by name: those with cameras, and that of the trigger. Empty
/// for a take without a studio file, as an imported one. Throws InputError when the studio file
/// cannot be read.
std::vector<TakeNode> capture_nodes(const TakePaths& paths);

/// Writes the node as a table `[[key]]`, and reads the nodes of all such tables.
void write_node(std::string_view key, const TakeNode& node, TomlWriter& file);
std::vector<TakeNode> read_nodes(const TomlTable& table, std::string_view key);

/// "cap02 (cam03, cam04), cap03".
std::string text_of(const std::vector<TakeNode>& nodes);

// A range of frame numbers of a take.

/// Frames by number (the pulse, counted from 0): begin <= n < end.
struct FrameRange {
  int64_t begin = 0;
  int64_t end = std::numeric_limits<int64_t>::max();
  bool contains(int64_t frame) const { return frame >= begin && frame < end; }
  friend bool operator==(const FrameRange&, const FrameRange&) = default;
};

}  // namespace v3d::take
