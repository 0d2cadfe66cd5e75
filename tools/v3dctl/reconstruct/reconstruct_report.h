// Measurements of a reconstruction, of a whole take or of one shard.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "base/geometry/rigid_transform.h"
#include "recon/metrics/frame_quality.h"
#include "v3dctl/reconstruct/reconstruct_request.h"
#include "v3dctl/reconstruct/take_surfaces.h"

namespace v3d::ctl {

/// Durations of one stage in milliseconds, one for each frame in which it ran.
struct StageSamples {
  std::string name;
  std::vector<double> ms;
};

struct ReconstructReport {
  std::vector<std::string> cameras;
  Box bounds;
  double voxel_m = 0;
  Quality quality = Quality::kLive;
  int min_views = 0;
  int threads = 0;  ///< of all processes; of a Slurm job, of one task
  int64_t frames = 0;
  /// Frames for which a camera has no usable frame, and pulses without any frame. A camera that the
  /// silhouette repair left out has one.
  int64_t incomplete = 0;
  /// Pulses without a mesh, and why: their surface exceeds the limits of a compact frame.
  std::vector<std::pair<int64_t, std::string>> oversized;
  std::vector<std::string> read_errors;                                   ///< path and cause
  std::vector<double> volume_m3, vertices, triangles, components, bytes;  ///< one for each frame
  std::vector<double> ghosts;  ///< components removed by GhostRemoval, one for each frame
  /// Intersection over union of the rendered surface and the mask within the view of the bounds;
  /// one for each frame and camera.
  std::vector<double> silhouette_iou;
  std::vector<std::vector<double>> camera_iou;  ///< the same, by camera
  std::vector<std::pair<int64_t, recon::FrameQuality>>
      frame_quality;                          ///< by pulse, as live meshes have it
  bool repaired = false;                      ///< silhouette repair was requested
  std::vector<PulseFault> silhouette_faults;  ///< repaired ones
  std::vector<StageSamples> stages;  ///< segment intersect mesh deform steady texture encode
                                     ///< quality total
  double seconds = 0;                ///< of the whole run
  int processes = 1;                 ///< at a time; 0: of a cluster
  int64_t frames_kept = 0;           ///< part of `frames` that an earlier run made
  double peak_rss_mb = 0;            ///< of this process or the largest task, 10^6 bytes
  /// One report of the proxy; empty without one. It has the values of each frame and camera, except
  /// `incomplete`, `oversized`, faults and read errors, which are those of the mesh.
  std::vector<ReconstructReport> proxy;
};

/// A report without frames, of a complete request.
ReconstructReport empty_report(const Rig& rig, const ReconstructRequest& complete, int threads);

/// Appends the frames of `part` to `whole`. Requires equal arguments of their empty_report().
void append(ReconstructReport& whole, const ReconstructReport& part);

/// Throws InputError when `first`, the report of the first shard of a run, has pulses and no mesh:
/// the voxel is probably too small for the whole take.
void require_meshes(const ReconstructReport& first);

/// The pulses of `report` that have ReconstructRequest::live_passes although `request` states the
/// passes of single pulses. Ascending.
std::vector<int64_t> pulses_with_default_passes(const ReconstructRequest& request,
                                                const ReconstructReport& report);

/// The values that append() reads, as JSON.
nlohmann::ordered_json samples_to_json(const ReconstructReport& part);
/// Sets these values of `part`. Requires equal arguments of empty_report(). Throws
/// nlohmann::json::exception for other JSON.
void read_samples(const nlohmann::ordered_json& json, ReconstructReport& part);

}  // namespace v3d::ctl
