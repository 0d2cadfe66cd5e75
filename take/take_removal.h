// Removal of takes: the only code of the project that deletes or moves away what was recorded.
//
// A test (tests/take/no_removal_test) asserts that no other source file calls unlink, remove_all,
// resize_file, ftruncate and their like on the files of a take.
#pragma once

#include <filesystem>

#include "base/io/result.h"
#include "take/take.h"

namespace v3d {

/// Folder inside the takes folder for takes that looked empty; no take may have this name.
inline constexpr const char* kQuarantineFolder = "quarantine";

/// Deletes a take. The take leaves the list in one step, whatever interrupts the rest.
[[nodiscard]] io::Status delete_take(const TakePaths& paths);

/// True when some log of a camera has a byte, or the folder cannot be read.
bool may_hold_frames(const TakePaths& paths);

/// Moves a take without frames to <takes>/quarantine/<name>, or <name>.2 and so on where that name
/// is taken. Returns its new place.
[[nodiscard]] io::Result<std::filesystem::path> quarantine_take(const TakePaths& paths);

/// Removes mesh.v3d when it has no byte behind its header but an empty index, and then the folder
/// when nothing else is in it. Anything else stays.
void remove_mesh_file_without_meshes(const TakePaths& paths);

/// Removes a file that only daemons use while a take is recorded. Requires a hidden name
/// (".reserve", ".order-cap01"). A file that cannot be removed stays, and does no harm.
void remove_working_file(const std::filesystem::path& file);

}  // namespace v3d
