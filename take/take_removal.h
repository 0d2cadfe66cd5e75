// Removal of takes. Only this code deletes or moves recorded files.
//
// tests/take/removal_calls.py finds all calls in sources and scripts that remove, shorten or
// overwrite files, and removal_calls.txt lists for each call the files that it may reach.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/io/file.h"
#include "take/take.h"

namespace v3d::take {

/// Folder inside the takes folder for takes that appeared to be empty. No take may have this name.
inline constexpr const char* kQuarantineFolder = "quarantine";

/// Succeeds for a folder whose files can all be deleted as those of one take. Fails with path and
/// cause when the folder is a symbolic link, because the take is elsewhere, and when it has
/// foreign_entries(), because no verification and no copy includes them.
[[nodiscard]] io::Status check_removable(const TakePaths& paths);

/// Deletes a take that check_removable() accepts: renames its folder to ".deleted-<name>", then
/// removes it. After an interruption the take is no longer listed, and finish_deletion() removes
/// the rest. Fails with path and cause.
[[nodiscard]] io::Status delete_take(const TakePaths& paths);

/// The rest of a deletion that was interrupted: of the process, by a power cut or by a disk error.
struct InterruptedDeletion {
  std::string take;
  std::filesystem::path folder;  ///< ".deleted-<take>" in the folder of takes
};
/// The interrupted deletions in a folder of takes, sorted by name. Fails with path and cause.
[[nodiscard]] io::Result<std::vector<InterruptedDeletion>> interrupted_deletions(
    const std::filesystem::path& takes);
/// Removes the folder of an interrupted deletion and all files in it. Fails with path and cause.
[[nodiscard]] io::Status finish_deletion(const InterruptedDeletion& deletion);

/// True when a camera log contains at least one byte, or the folder cannot be read.
bool may_hold_frames(const TakePaths& paths);

/// Moves a take without frames to <takes>/quarantine/<name>, or to <name>.2 and so on when that
/// name exists. Returns the new path.
[[nodiscard]] io::Result<std::filesystem::path> quarantine_take(const TakePaths& paths);

/// Removes mesh.v3d when it contains only a header and an empty index, then the folder when it is
/// empty. Removes no other file.
void remove_mesh_file_without_meshes(const TakePaths& paths);

/// Removes a segment of a log that has no byte. Errors are ignored: an empty segment has no events.
void remove_empty_log(const std::filesystem::path& segment);

/// Removes a working file that daemons use during recording. Requires a hidden name (".reserve",
/// ".order-cap01"). Errors are ignored: a remaining file has no effect.
void remove_working_file(const std::filesystem::path& file);

}  // namespace v3d::take
