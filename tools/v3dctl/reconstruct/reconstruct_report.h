// What is told of a reconstruction, of a whole take or of a piece of it.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "base/geometry.h"
#include "recon/frame_quality.h"
#include "recon/reconstructor.h"
#include "v3dctl/reconstruct/silhouette_repair.h"

namespace v3d::ctl {

/// Milliseconds of one stage, one value per frame in which it ran.
struct StageSamples {
  std::string name;
  std::vector<double> ms;
};

struct ReconstructReport {
  std::vector<std::string> cameras;
  Box bounds;
  double voxel_m = 0;
  int min_views = 0;
  int threads = 0;  ///< in all; of an array job, of one task
  int64_t frames = 0;
  int64_t incomplete = 0;  ///< frames to which a camera was missing, and pulses without any frame
  std::vector<std::string> read_errors;  ///< what of the take could not be read; path and cause
  std::vector<double> volume_m3, vertices, triangles, components, bytes;  ///< one per frame
  /// How the surface, drawn into a camera, agrees with its mask as far as that lies before the
  /// bounds; one per frame and camera.
  std::vector<double> silhouette_iou;
  std::vector<std::vector<double>> camera_iou;            ///< the same, by camera
  std::vector<std::pair<int64_t, FrameQuality>> quality;  ///< by pulse, as goes with live meshes
  bool mended = false;
  std::vector<PulseFault> silhouette_faults;  ///< where they were mended
  std::vector<StageSamples> stages;  ///< segment intersect mesh deform steady texture encode
                                     ///< quality total
  double seconds = 0;                ///< the whole run
  int processes = 1;                 ///< at a time; 0: as many as a cluster has room for
  int64_t frames_kept = 0;           ///< of `frames`, that an earlier run had made
  double peak_rss_mb = 0;            ///< of this process or the largest task, 10^6 bytes
};

/// No frames yet.
ReconstructReport begin_report(const Rig& rig, const ReconstructOptions& options, bool mended);

/// The frames of `piece`, which was begun alike, go behind those of `whole`.
void append(ReconstructReport& whole, const ReconstructReport& piece);

/// All that append() takes, with every sample.
nlohmann::ordered_json samples_to_json(const ReconstructReport& piece);
/// Into one that was begun alike. Throws nlohmann::json::exception for anything else than such
/// samples.
void read_samples(const nlohmann::ordered_json& json, ReconstructReport& piece);

}  // namespace v3d::ctl
