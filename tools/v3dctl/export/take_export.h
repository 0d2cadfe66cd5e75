// Exports of a whole take: formats that are not one file for each frame, and the sound.
// docs/export.md describes them.
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "take/take.h"

namespace v3d::ctl {

enum class TakeFormat {
  kGlbSequence,  ///< one animated GLB file
  kUsda,         ///< one USD text file with time samples
  kColmap,       ///< a folder for COLMAP; several pulses: one folder each
  kNerfstudio,   ///< a folder for Nerfstudio; several pulses: one folder each
};

/// Parses "glb-sequence", "usda", "colmap" and "nerfstudio"; empty for other text.
std::optional<TakeFormat> parse_take_format(std::string_view text);

/// Which surfaces kGlbSequence and kUsda contain. Training sets contain kMeshes.
enum class Surface {
  kAutomatic,  ///< kTracked where the take has motion.v3d and all performers are exported
  kMeshes,     ///< mesh.v3d
  kTracked,    ///< motion.v3d: constant triangles over many pulses
  kProxy,      ///< proxy.v3d
};

/// Parses "automatic", "meshes" and "tracked". Throws InputError for other text.
Surface parse_surface(std::string_view text);

struct TakeExport {
  std::filesystem::path take, out;
  TakeFormat format = TakeFormat::kColmap;
  take::FrameRange frames = {};
  int performer = 0;  ///< kGlbSequence and kUsda: this performer alone; 0: all
  Surface surface = Surface::kAutomatic;
};

/// Writes `out`, which appears when it is complete. Reports the pulses without a mesh, and frames
/// that are missing, in a line each on stderr. Returns the exit status. Throws InputError for a
/// take without the meshes or raw frames that the format needs, options that it does not support,
/// a file name without its ending (.glb, .usda), and when `out` is a folder with files;
/// std::runtime_error with the path for errors of the disk.
int export_take(const TakeExport& request);

// The sound of a take as FLAC files.

/// Writes each sound file of the ledger as `out`/<name>.flac, by the program ffmpeg: all samples
/// and channels, 24 bit, without loss. Its tags have the fields of `bext` (sound/wave_file.h),
/// among them time_reference, the samples since midnight. `out`: a new or empty folder. Returns
/// kExitDone. Throws InputError for a take without sound, a file with more channels than FLAC has,
/// and without ffmpeg; std::runtime_error where ffmpeg fails.
int export_flac(const std::filesystem::path& take, const std::filesystem::path& out);

}  // namespace v3d::ctl
