// Recorded files: the files of a take (docs/takes.md), which no result of a command may replace.
#pragma once

#include <filesystem>

namespace v3d {

/// True when `path` names a recorded file:
/// - a log (*.lcmlog) or its index (*.lcmlog.index), in any folder, also when it does not exist
/// yet;
/// - an existing file with a name of a take's files, or below its folders `background` and `sound`,
/// in a folder
///   with a take.toml.
/// A folder that cannot be read counts as no take: then the file cannot be replaced, either.
bool is_recorded_file(const std::filesystem::path& path);

/// Throws InputError when `path` names a recorded file.
void require_unrecorded(const std::filesystem::path& path);

}  // namespace v3d
