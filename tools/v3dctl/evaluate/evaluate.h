// Evaluation of a reconstructed take, against the true surface and against held-out cameras.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/image/image.h"
#include "base/image/mask.h"
#include "daemon/recorded/mesh_frames.h"
#include "daemon/recorded/take_frames.h"
#include "recon/metrics/evaluation.h"

namespace v3d::ctl {

/// Meshes to evaluate: those of `meshes`, a mesh file or motion file of the same take, otherwise
/// the take's mesh.v3d.
struct EvaluatedMeshes {
  std::filesystem::path take;
  std::optional<std::filesystem::path> meshes{};
};
recorded::MeshFrames open_meshes(const EvaluatedMeshes& evaluated);

/// Largest correct distance of a point, metres, for the report by the number of cameras that see
/// it.
inline constexpr double kVisibilityLimitM = 0.005;

/// A true surface is in one component when other components than the largest cover at most this
/// part of it.
inline constexpr double kMaxApart = 0.03;

/// Medians over the frames that have a true surface, where nothing else is said.
struct TruthReport {
  int64_t frames = 0;
  int64_t without_truth = 0;  ///< frames without a PLY file
  recon::SurfaceDistance distance;
  double min_covered_10mm = 0;         ///< minimum over the frames
  double mean_covered_10mm = 0;        ///< mean over the frames
  int64_t joined_frames = 0;           ///< with the true surface in one component (kMaxApart)
  double self_intersections = 0;       ///< pairs of triangles
  recon::VisibilityReport visibility;  ///< by the number of used cameras, kVisibilityLimitM; means
  /// Frames with a mesh and a true surface whose previous pulse has both, too.
  int64_t consecutive = 0;
  int64_t still_frames = 0;   ///< of these, those where some of the truth did not move
  int64_t moving_frames = 0;  ///< of these, those where some of the truth moved
  /// Parts: medians over the consecutive frames. Distances: medians over still_frames or
  /// moving_frames; 0 where there is none.
  recon::SurfaceChange change;
};

/// Compares the meshes with the true surfaces; that of frame 12 is `truth`/000012.ply. Throws
/// InputError when no frame has one.
TruthReport evaluate_truth(const EvaluatedMeshes& evaluated, const std::filesystem::path& truth);
/// Whether all frames of `meshes`, a name, have a true surface in the folder `truth`; reports it on
/// stderr otherwise.
bool has_all_truth(const TruthReport& report, const std::filesystem::path& truth,
                   const std::string& meshes);
/// The file of the true surface of a frame.
std::filesystem::path truth_path(const std::filesystem::path& truth, int64_t frame);
/// True surface of a frame; empty when there is none.
std::optional<Mesh> read_truth(const std::filesystem::path& truth, int64_t frame);

/// Similarity of a rendering and a photograph.
struct ImageSimilarity {
  double psnr_db = 0;
  double ssim = 0;
};

/// Means over the frames with foreground in the image of the camera; without meaning where there
/// are none.
struct HeldOutReport {
  std::string camera;
  int64_t frames = 0;
  int64_t missing = 0;         ///< frames without a readable image of the camera
  ImageSimilarity inside;      ///< over HeldOutView::inside()
  ImageSimilarity whole_mask;  ///< over the mask, with background at its rim
  /// The same mesh with a texture atlas instead of colours of vertices, over inside().
  std::optional<ImageSimilarity> atlas{};
  double iou = 0;  ///< of the rendered silhouette and the mask
  /// The true surface, coloured from the used cameras: nearly an upper bound for reconstructions.
  /// Over inside(), of the frames with a true surface.
  std::optional<ImageSimilarity> true_surface;
};

struct HeldOutRequest {
  std::vector<std::string> cameras;
  bool view_dependent = false;  ///< render with view-dependent colours for the camera
  /// Of these colours; resolved().
  recorded::ViewSource view_source = recorded::ViewSource::kPhotographs;
  std::filesystem::path truth{};  ///< as for evaluate_truth(); empty: none
  int atlas_side = 0;             ///< texels of the atlas to compare with; 0: none
};

/// Compares renderings of the meshes with the photographs of held-out cameras (HeldOutView). Throws
/// InputError for a camera that the take does not have, for one that took part, and for a true
/// surface that cannot have edges as short as those of the mesh.
std::vector<HeldOutReport> evaluate_held_out(const EvaluatedMeshes& evaluated,
                                             const HeldOutRequest& request);

// View of a held-out camera: its photograph, and renderings of meshes that compare with it.

/// Renderings pass through the colour response of the camera and the Bayer filters of its sensor,
/// like the photograph. So both contain the same false colours of the mosaic, which then do not
/// count as errors.
class HeldOutView {
 public:
  /// `camera` is borrowed.
  HeldOutView(const RigCamera& camera, const recorded::SegmentedFrame& frame);

  /// RGB8 of the whole image, in the common colours of the rig.
  const Image& photograph() const { return photograph_; }
  const Mask& mask() const { return mask_; }
  /// Pixels whose neighbours up to two pixels away, the reach of demosaicing, are foreground, too.
  /// All differ from the background where the frame has a background difference.
  const Mask& inside() const { return inside_; }
  /// Rendering of `mesh` with the colours of its vertices, or those of `atlas`, comparable with
  /// photograph().
  Image render(const Mesh& mesh, const recon::TextureAtlas* atlas = nullptr) const;

 private:
  Image as_recorded(Image rendering) const;

  const RigCamera& camera_;
  const PixelFormat format_;
  const Mask mask_;
  const Mask inside_;
  const Image photograph_;
};

/// Images of a HeldOutView for people, cropped to the foreground.
class CroppedHeldOutView {
 public:
  /// Requires a mask with foreground. `camera` is borrowed.
  CroppedHeldOutView(const RigCamera& camera, const recorded::SegmentedFrame& frame);
  Image photograph() const;
  /// HeldOutView::render()
  Image render(const Mesh& mesh, const recon::TextureAtlas* atlas = nullptr) const;
  /// Absolute difference of both over inside(): black for 0, white for 64 grey values and more.
  Image difference(const Mesh& mesh, const recon::TextureAtlas* atlas = nullptr) const;

 private:
  Image crop(const Image& whole) const;

  const HeldOutView view_;
  const Rect region_;
};

// Evaluation of a tracked surface: how far it carries points from where they truly are.

struct CarriedReport {
  int64_t pulses = 0;  ///< since the first
  recon::EndPointError all, sleeves, sword;
  /// Nearest-point propagation over mesh.v3d instead of the tracked surface.
  std::optional<recon::EndPointError> nearest_point;
};

/// Carries the points of `truth`/points from the first pulse to the others. Points count that some
/// camera sees at some of these pulses. From one segment to the next, points change over at the
/// pulse that both share; without one, they keep their velocity for one pulse.
struct MotionReport {
  int64_t first_pulse = 0;
  int64_t segments = 0;
  double mean_segment_pulses = 0;
  double bound =
      0;  ///< part of the seen points that lies on the tracked surface at the first pulse
  std::vector<CarriedReport> carried;  ///< after every 25 pulses, and at the end
};

/// Empty when `evaluated` is no motion file, or the truth has no points. Throws InputError for
/// files that cannot be read, for points without colours, and after an interrupt.
std::optional<MotionReport> evaluate_motion(const EvaluatedMeshes& evaluated,
                                            const std::filesystem::path& truth);

// Figures of an evaluation as the commands print them with --json.

/// Sets the keys of a comparison with the truth.
void put_truth(nlohmann::ordered_json& json, const TruthReport& report);
nlohmann::ordered_json to_json(const MotionReport& report);

// Evaluation as an HTML page: measurements, errors as colours of the mesh, photographs and
// renderings.

/// One set of meshes and its measurements.
struct EvaluationColumn {
  std::string name;
  EvaluatedMeshes evaluated;
  std::optional<TruthReport> truth;
  std::vector<HeldOutReport> held_out;
  std::optional<MotionReport> motion{};
};

struct EvaluationPage {
  std::vector<EvaluationColumn> columns;  ///< of the same take; at least one
  std::filesystem::path truth;            ///< empty: none
  std::vector<std::string> held_out;      ///< cameras
  bool view_dependent = false;            ///< as in HeldOutRequest
  recorded::ViewSource view_source = recorded::ViewSource::kPhotographs;
  int atlas_side = 0;  ///< as in HeldOutRequest
};

/// One HTML file that contains its images: of the middle one of the frames that all columns have,
/// or none.
std::string evaluation_html(const EvaluationPage& page);

/// Scale of error colours: evenly spaced from 0 to kMaxErrorMm; greater errors have the last
/// colour.
inline constexpr double kMaxErrorMm = 20;
inline constexpr Rgb8 kErrorColours[] = {
    {49, 100, 180}, {116, 183, 215}, {245, 240, 190}, {247, 158, 85}, {200, 30, 40}};

/// Renderings of the mesh from four sides, coloured by the distance of each vertex from the truth.
/// The cameras depend on the truth only, so that several meshes have equal views.
std::vector<Image> error_renderings(const Mesh& mesh, const Mesh& truth);

}  // namespace v3d::ctl
