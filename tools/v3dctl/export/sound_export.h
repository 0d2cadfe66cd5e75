// The sound of a take as FLAC files.
#pragma once

#include <filesystem>

namespace v3d::ctl {

/// Writes each sound file of the ledger as `out`/<name>.flac, by the program ffmpeg: all samples
/// and channels, 24 bit, without loss. Its tags have the fields of `bext` (sound/wave_file.h),
/// among them time_reference, the samples since midnight. `out`: a new or empty folder. Returns
/// kExitDone. Throws InputError for a take without sound, a file with more channels than FLAC has,
/// and without ffmpeg; std::runtime_error where ffmpeg fails.
int export_flac(const std::filesystem::path& take, const std::filesystem::path& out);

}  // namespace v3d::ctl
