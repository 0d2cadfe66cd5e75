// Reconstruction of a take in one process, and the mesh file that it writes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "daemon/recorded/take_frames.h"
#include "recon/pipeline/reconstructor.h"
#include "take/logs/mesh_file.h"
#include "v3dctl/reconstruct/reconstruct_report.h"
#include "v3dctl/reconstruct/reconstruct_request.h"
#include "v3dctl/reconstruct/take_silhouette_repair.h"

namespace v3d::ctl {

/// Reconstructs the take and replaces its mesh.v3d when all frames are done.
/// Throws InputError for bad input, and std::runtime_error for errors of the disk and after an
/// interrupt; the old mesh.v3d then stays.
ReconstructReport reconstruct_take(const ReconstructRequest& request);

/// Mesh file with a temporary name until finish(). The destructor removes an unfinished file. One
/// thread.
class PendingMeshFile {
 public:
  /// `path`: the final path. Throws InputError when the file cannot be created.
  explicit PendingMeshFile(const std::filesystem::path& path);
  ~PendingMeshFile();
  PendingMeshFile(const PendingMeshFile&) = delete;
  PendingMeshFile& operator=(const PendingMeshFile&) = delete;

  /// Requires increasing pulses. Throws std::runtime_error with path and cause for errors of the
  /// disk.
  void append(int64_t pulse, const std::vector<uint8_t>& compact);
  /// Syncs the file and renames it. Throws as append().
  void finish();

 private:
  std::filesystem::path path_;
  std::filesystem::path temporary_path_;
  take::MeshFileWriter file_;
  bool finished_ = false;
};

/// Suffix of temporary names: host and process.
std::string process_suffix();

/// Reconstructs ranges of pulses. The mesh of a pulse depends on this pulse and its neighbours, its
/// bytes also on the frames since the last key frame: ranges that begin with a key frame have the
/// same bytes as in the whole take. One caller at a time.
class TakeReconstruction {
 public:
  /// `complete`: a result of with_defaults() for this take. Throws InputError as Reconstructor
  /// does.
  TakeReconstruction(const ReconstructRequest& complete, int threads, recorded::TakeFrames take);
  ~TakeReconstruction();

  /// Appends the meshes of `pulses` to `file`, the first as a key frame, and calls `on_frame` after
  /// each. Returns the measurements, without `seconds`.
  /// Requires increasing pulses, after those of earlier calls. Throws InputError for bad frames,
  /// and std::runtime_error for errors of the disk and after an interrupt.
  ReconstructReport make(std::span<const int64_t> pulses, PendingMeshFile& file,
                         const std::function<void()>& on_frame);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// Surfaces of a take, pulse by pulse, with temporal smoothing.

/// Surface of one pulse; its vertices have no colours yet.
struct TakeSurface {
  SegmentedFrames frames;
  double segment_ms = 0;
  recon::FrameSetJob work;
};

/// A smoothed surface depends on the surfaces one pulse before and after, and these on the views
/// one pulse farther: a window of two pulses to each side, of three with silhouette repair. It
/// depends on nothing else, so order and shards do not change it. One caller at a time, in its TBB
/// arena.
class TakeSurfaces {
 public:
  /// All references are borrowed. `passes`: FrameSetJob::live_passes by pulse. `repair` and
  /// `live_repair`: null for none. Without `smooth`, each pulse is reconstructed alone.
  TakeSurfaces(recorded::TakeFrames& take, recon::Reconstructor& reconstructor,
               const std::map<int64_t, int>& passes, TakeSilhouetteRepair* repair,
               LivePulseRepair* live_repair, bool smooth);

  /// Requires increasing pulses that the take has. Throws as TakeFrames::read().
  TakeSurface make(int64_t pulse);

 private:
  struct WindowEntry {
    TakeSurface surface;  ///< a hull until `deformed`; moved away by make()
    recon::PulseViews views;
    bool deformed = false;
  };
  bool has(int64_t pulse) const;
  TakeSurface read(int64_t pulse);
  void set_previous_of(int64_t pulse);
  void repair(int64_t pulse, SegmentedFrames& frames);
  void make_hull(int64_t pulse);
  void deform(int64_t pulse);
  std::vector<const recon::PulseViews*> neighbours(int64_t pulse) const;

  recorded::TakeFrames& take_;
  recon::Reconstructor& reconstructor_;
  const std::map<int64_t, int>& passes_;
  TakeSilhouetteRepair* repair_;
  LivePulseRepair* live_repair_;
  const bool smooth_;
  const std::vector<int64_t> pulses_;  ///< of the take, increasing
  std::map<int64_t, WindowEntry> window_;
  int64_t next_pulse_ = -1;
  SegmentedFrames next_;  ///< frames of next_pulse_, already read for the repair
};

}  // namespace v3d::ctl
