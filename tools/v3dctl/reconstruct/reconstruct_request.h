// Request of a reconstruction, and the default bounds of its space.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/config/studio_file.h"
#include "base/geometry/camera_model.h"
#include "base/geometry/rigid_transform.h"
#include "daemon/recorded/take_frames.h"
#include "recon/pipeline/reconstructor.h"
#include "recon/surface/deform.h"
#include "v3dctl/options.h"

namespace v3d::ctl {

/// "live", "medium" or "high".
std::string_view name(Quality quality);
/// The quality of this name. Throws InputError for another one; `option`: for the message.
Quality parse_quality(std::string_view text, std::string_view option);

// Request to reconstruct a take: its frames, cameras, bounds and quality.

struct ReconstructRequest {
  std::filesystem::path take;
  std::optional<Box> bounds;       ///< metres; otherwise the studio's, otherwise default_bounds()
  std::optional<double> voxel_m;   ///< otherwise the studio's, otherwise 10 mm
  std::optional<int> min_views;    ///< otherwise the studio's, otherwise default_min_views()
  std::optional<Quality> quality;  ///< otherwise the studio's, otherwise live
  /// A second mesh of each pulse, in proxy.v3d; larger than `voxel_m`. Empty: none.
  std::optional<double> proxy_voxel_m;
  std::optional<Quality> proxy_quality;  ///< at most `quality`; otherwise `quality`
  /// Only with medium quality, of the mesh or the proxy: ReconstructOptions::live_passes; otherwise
  /// kDefaultLivePasses.
  std::optional<int> live_passes;
  /// Instead of live_passes, of single pulses; as there only with medium quality.
  std::map<int64_t, int> pulse_passes;
  std::optional<recon::DeformOptions> deform;  ///< only with high quality; otherwise its defaults
  bool smooth = true;                          ///< temporal smoothing, with high quality
  bool repair = false;                         ///< silhouette repair before the reconstruction
  /// Silhouette repair of these pulses as v3d-recond did it; ascending. Not with `repair`.
  std::optional<std::vector<int64_t>> repair_pulses;
  take::FrameRange frames;
  int threads = 0;                     ///< 0: one per core
  std::vector<std::string> leave_out;  ///< cameras
  std::optional<Studio> studio;        ///< gives defaults if the take belongs to this studio
};

/// Throws InputError for a folder that is no take, and while a process records or recovers the
/// take.
take::TakeInfo info_of_ended_take(const take::TakePaths& take);

/// Opens the frames of the requested cameras. Throws InputError as info_of_ended_take(), and for an
/// unknown camera.
recorded::TakeFrames open_take(const ReconstructRequest& request);

/// The cameras of a take without those of `leave_out`. Throws InputError for a name that the take
/// does not have, and when no camera remains.
std::vector<std::string> cameras_without(const take::TakeInfo& info,
                                         const std::vector<std::string>& leave_out);

/// Sets all optional values of the request that depend on the take or the studio, so that every
/// process uses the same. Prints default_bounds() on stderr where they are used. Throws InputError
/// for more views than cameras, for a proxy with no larger voxels or a higher quality than the
/// mesh, and for passes or parameters of a quality that neither mesh nor proxy has.
ReconstructRequest with_defaults(const ReconstructRequest& request,
                                 const recorded::TakeFrames& take);

// The functions below marked "complete" require a result of with_defaults().

/// Options of the reconstructor for a complete request.
recon::ReconstructOptions options_of(const ReconstructRequest& complete, int threads);

/// The request that makes the proxy of a complete request alone, as the mesh. Requires
/// proxy_voxel_m.
ReconstructRequest proxy_request(const ReconstructRequest& complete);

/// Path of the proxy of a complete request; empty without one.
std::optional<std::filesystem::path> proxy_path(const ReconstructRequest& complete,
                                                const take::TakePaths& take);

/// A complete request as JSON, without the take, and back. The second throws
/// nlohmann::json::exception for other JSON.
nlohmann::ordered_json request_to_json(const ReconstructRequest& complete);
ReconstructRequest request_from_json(const nlohmann::ordered_json& json);

/// Pulses of the requested frames, increasing. Throws InputError when there is none.
std::vector<int64_t> pulses_of(const ReconstructRequest& request, const recorded::TakeFrames& take);

/// Number of requested pulses that were commanded and have no frame of any camera.
int64_t pulses_without_frames(const ReconstructRequest& request, const recorded::TakeFrames& take);

/// Number of worker threads: the requested one, otherwise one per core.
int threads_of(const ReconstructRequest& request);

// Default bounds of the reconstruction, where neither the user nor a studio file gives them.

/// Number of views below which space is empty: 4, and with few cameras all but one, because a voxel
/// outside of one camera's image may belong to the body.
int default_min_views(int cameras);

/// Box around the points that at least `min_cameras` cameras see (world frame, metres). Points are
/// limited to a ball around the point nearest to all optical axes, with the median distance of the
/// cameras as radius, and sampled on a 64^3 grid.
/// Throws InputError when there is no such point, and for cameras whose views do not converge.
Box observed_bounds(const Rig& rig, int min_cameras);

/// observed_bounds() by at least half the cameras and at least `min_views` of them.
Box default_bounds(const Rig& rig, int min_views);

}  // namespace v3d::ctl
