// A take to mesh.v3d, with figures about the result.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/geometry.h"
#include "base/studio_file.h"
#include "recon/deform.h"
#include "recon/frame_quality.h"
#include "v3dctl/mask_mending.h"
#include "v3dctl/options.h"

namespace v3d::ctl {

struct ReconstructRequest {
  std::filesystem::path take;
  std::optional<Box> bounds;       ///< else the studio's space, else common_view()
  std::optional<double> voxel_m;   ///< else the studio's, else 10 mm
  std::optional<int> min_views;    ///< else the studio's, else default_min_views()
  std::optional<Quality> quality;  ///< else the studio's, else live
  DeformOptions deform;            ///< for high quality
  bool steady = true;              ///< with high quality: TakeSurfaces' smoothing over time
  bool mend = false;               ///< hold the silhouettes against each other first
  FrameRange frames;
  int threads = 0;  ///< 0: one per core
  std::vector<std::string> leave_out;
  std::optional<Studio> studio;  ///< gives defaults when it is the take's
};

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
  int threads = 0;
  int64_t frames = 0;
  int64_t incomplete = 0;  ///< frames to which a camera was missing, and pulses without any frame
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
  double peak_rss_mb = 0;            ///< of this process, 10^6 bytes
};

/// Replaces the take's mesh.v3d when all frames are done. Throws InputError for bad input; the old
/// mesh.v3d then stays.
ReconstructReport reconstruct_take(const ReconstructRequest& request);

/// 4, as in the studio file, but with few cameras all but one: a voxel that one of four does not
/// see may still be part of the body.
int default_min_views(int cameras);

}  // namespace v3d::ctl
