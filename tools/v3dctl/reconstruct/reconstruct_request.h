// What of a take is to be reconstructed, and how.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/geometry.h"
#include "base/studio_file.h"
#include "daemon/recorded/take_frames.h"
#include "recon/deform.h"
#include "recon/reconstructor.h"
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

/// The frames that the request is about.
TakeFrames open_take(const ReconstructRequest& request);

/// The request without what it left open, so that whoever carries it out does the same. Says on
/// stderr which bounds were found. Throws InputError for more views than cameras.
ReconstructRequest settle(const ReconstructRequest& request, const TakeFrames& take);

/// Of a settled request.
ReconstructOptions options_of(const ReconstructRequest& settled, int threads);

/// Rising. Throws InputError when there is none.
std::vector<int64_t> pulses_of(const ReconstructRequest& request, const TakeFrames& take);

/// Those that were commanded, are asked for, and have no frame.
int64_t pulses_without_frames(const ReconstructRequest& request, const TakeFrames& take);

/// 4, as in the studio file, but with few cameras all but one: a voxel that one of four does not
/// see may still be part of the body.
int default_min_views(int cameras);

/// As many as are asked for, else one per core.
int threads_of(const ReconstructRequest& request);

}  // namespace v3d::ctl
