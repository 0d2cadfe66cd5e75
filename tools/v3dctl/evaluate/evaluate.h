// How good is a reconstructed take: against the true surface, and against cameras that took no
// part.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/recorded/mesh_frames.h"
#include "recon/evaluation.h"
#include "recon/sight.h"

namespace v3d::ctl {

/// What is evaluated. Without `meshes` it is the take's mesh.v3d; another mesh file of the same
/// take may be one of another quality, say.
struct Evaluated {
  std::filesystem::path take;
  std::optional<std::filesystem::path> meshes{};
};
MeshFrames frames_of(const Evaluated& evaluated);

inline constexpr double kSightLimitM = 0.005;

/// Medians over the frames that have a true surface.
struct TruthReport {
  int64_t frames = 0;
  int64_t without_truth = 0;  ///< reconstructed frames that have no PLY
  SurfaceDistance distance;
  double least_covered_10mm = 0;  ///< in the worst frame
  double self_intersections = 0;  ///< pairs of triangles
  SightReport sight;              ///< by the cameras that took part, within kSightLimitM; means
  int64_t in_a_row = 0;           ///< frames with a truth whose pulse before has one too
  SurfaceChange change;           ///< medians over these
};

/// `truth`/000012.ply is the true surface of frame 12. Throws InputError when no frame has one.
TruthReport evaluate_truth(const Evaluated& evaluated, const std::filesystem::path& truth);
/// The true surface of a frame; empty when there is none.
std::optional<Mesh> read_truth(const std::filesystem::path& truth, int64_t frame);

/// A drawing against the photograph.
struct PictureFigures {
  double psnr_db = 0;
  double ssim = 0;
};

/// Means over the frames in which the camera sees something.
struct HeldOutReport {
  std::string camera;
  int64_t frames = 0;
  PictureFigures inside;      ///< where the photograph shows foreground alone
  PictureFigures whole_mask;  ///< with the rim of the mask, which shows background too
  double iou = 0;             ///< the drawn silhouette against the mask
  /// The true surface instead, coloured by the same cameras: what no reconstruction can beat by
  /// much. Inside; over the frames that have a truth, if there are any.
  std::optional<PictureFigures> true_surface;
};

struct HeldOutRequest {
  std::vector<std::string> cameras;
  bool view_dependent = false;    ///< drawn in the colours that FrameColours gives for the camera
  std::filesystem::path truth{};  ///< see evaluate_truth(); empty: none
};

/// Drawings and photographs are those of HeldOutView. Throws InputError for a camera that the take
/// does not have or that took part.
std::vector<HeldOutReport> evaluate_held_out(const Evaluated& evaluated,
                                             const HeldOutRequest& request);

}  // namespace v3d::ctl
