// Colours of vertices: blended, by camera, and for a viewpoint.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/image/colour.h"
#include "base/image/frame.h"
#include "codec/frame_codec.h"
#include "recon/hull/voxel_grid.h"
#include "recon/texture/colour_mask.h"
#include "recon/visibility/point_depth_buffer.h"

namespace v3d::recon {

// View-independent and view-dependent vertex colours. Source: the paper, Algorithm 1 (visibility)
// with the weights of equations (8) and (9), or Algorithm 2 with equation (7) for one viewpoint.

/// Interpolated colour of an image: R, G, B in grey values 0 to 255. (u, v) are pixel coordinates
/// with (0, 0) in the centre of the first pixel. The image is mirrored at its borders; outside of
/// it the result is empty.
///
/// A Bayer image is not demosaiced. Each colour is interpolated on its own lattice: red and blue
/// bilinearly with a spacing of 2 pixels, green on the quincunx, in a diamond around the point.
std::optional<Eigen::Vector3f> sample_colour(ImageView image, double u, double v);

/// A frame and its camera, borrowed. Requires frame->sensor_size == model->size().
struct TextureCamera {
  const CameraModel* model = nullptr;
  const Frame* frame = nullptr;
  const ColourResponse* colour = nullptr;  ///< null: colours are not corrected
};

/// A viewpoint of Algorithm 2.
struct ViewDependence {
  Eigen::Vector3d direction;  ///< V_eye: unit vector of its optical axis, world
  double sharpness = 10;      ///< m; the paper's value
};

/// Weight of a camera with the unit viewing direction `axis`, at most 1. It has a constant factor,
/// which equation (7) removes by normalisation.
float blending_weight(const Eigen::Vector3d& axis, const ViewDependence& eye);

/// `colour`, grey values, rounded to bytes and clamped.
Rgb8 rounded_colour(const Eigen::Vector3f& colour);

struct TextureOptions {
  /// A vertex is occluded when the depth buffer is nearer by more than this, metres. About three
  /// voxels: one for the error of the surface, two because the buffer holds points.
  double depth_tolerance_m = 0.03;
  /// On a slanted surface the tolerance grows by the change of depth within a cell of the
  /// PointDepthBuffer, up to this many widths of a cell.
  double max_slant = 6;
  /// Radius of occluding_points(), metres, and width of the depth cells. With 0.71 voxels, vertices
  /// alone are enough.
  double occluder_radius_m = 0.0071;
  /// Demosaic Bayer images before sampling. This shows finer detail than interpolation of each
  /// colour on its own lattice, and costs a pass over the pixels of every roi.
  bool demosaic = false;
  /// Weight cameras by the square of their resolution on the surface, -V_c . N_v times focal length
  /// over depth. (In the paper distance has no influence.)
  bool by_resolution = false;
  int fill_passes = 64;  ///< how far colour spreads to vertices without one, in edges
  /// Colours for this viewpoint: cameras with a similar viewing direction have larger weights.
  std::optional<ViewDependence> view = std::nullopt;
};

/// Colour of a vertex that no camera sees and no fill pass reaches.
inline constexpr Rgb8 kUnseenColour{128, 128, 128};

struct Texture {
  std::vector<Rgb8> colours;  ///< one per vertex
  /// One per vertex: 1 where a camera sees it as ColourMask::inner(), else 0.
  std::vector<uint8_t> seen;
  int64_t unseen = 0;  ///< vertices that no camera sees, or only as ColourMask::background_like()
};

/// Vertex v is visible in camera c when its normal faces the camera (V_c . N_v < 0 with V_c the
/// optical axis), no nearer surface is in the depth buffer, and sample_colour() has a result. The
/// colour of v is the weighted mean of the samples of these cameras, each corrected by its
/// ColourResponse. Weights are -V_c . N_v, or by_resolution, or for a viewpoint (V_eye . V_c + 2)^m
/// for all vertices.
///
/// Additions to the paper: a sample outside ColourMask::inner() counts only where no other camera
/// sees the vertex, because the background shines through at the rim of a silhouette. Vertices that
/// no camera sees, or only as ColourMask::background_like(), take the mean colour of their
/// neighbours, pass by pass. A background-like sample counts only where this reaches no vertex.
///
/// Deterministic: independent of thread count and of the order of `cameras`, which are sorted by
/// name. Names must differ.
Texture colour_vertices(const Mesh& mesh, std::span<const TextureCamera> cameras,
                        const TextureOptions& options);

// Accumulates the colours that one camera sees at the vertices of a mesh: the inner loop of the
// texture.

/// A ColourResponse in single precision: common colour = matrix * sample + offset, clamped to 0 to
/// 255.
struct SampleCorrection {
  Eigen::Matrix3f matrix;
  Eigen::Vector3f offset;
  explicit SampleCorrection(const ColourResponse& response)
      : matrix(response.matrix.cast<float>()),
        offset((-response.matrix * response.black).cast<float>()) {}
};

/// A camera prepared for one frame. Immutable; any thread.
struct VertexCamera {
  VoxelCamera lens;  ///< for points in metres
  Eigen::Vector3f axis{0, 0, 1};
  const Frame* frame = nullptr;  ///< borrowed; its roi is not empty
  /// The pixels of the roi in RGB, sampled instead of those of the frame where present.
  std::optional<Image> demosaiced = std::nullopt;
  ColourMask mask;
  PointDepthBuffer depth;
  float tolerance_m = 0;   ///< see TextureOptions::depth_tolerance_m
  float max_slant = 0;     ///< see TextureOptions::max_slant
  float cell_m_per_m = 0;  ///< width of a depth cell in metres at one metre of distance
  /// Weight of all samples. Empty: the square of `resolution` times cosine over depth, with the
  /// cosine between vertex normal and optical axis;
  std::optional<float> weight;
  /// or, with 0, the cosine alone.
  float resolution = 0;
  std::optional<SampleCorrection> colour = std::nullopt;  ///< applied to all samples
};

/// Weighted sums of equation (8) over cameras for a block of vertices: red, green and blue times
/// weight, and the weight.
struct ColourSums {
  using Sums = std::array<std::array<float, 4>, PointArrays::kBlock>;
  alignas(64) Sums inner{};  ///< samples of foreground pixels alone
  alignas(64) Sums rim{};    ///< samples that may contain background
  /// Samples of ColourMask::background_like(): probably background.
  alignas(64) Sums background_like{};
};

/// Adds the colours of vertices `first` to `first` + kBlock that `camera` sees: the normal faces
/// the camera, no nearer surface hides the vertex, and sample_colour() has a result. `normals`
/// belong to `vertices` (world, metres) and have unit length or are zero. Vectorised by run-time
/// dispatch; every instruction set gives the same bits.
void accumulate_vertex_colours(const VertexCamera& camera, const PointArrays& vertices,
                               const PointArrays& normals, size_t first, ColourSums& sums);

// Prepares the cameras of a frame set for accumulate_vertex_colours(). Source: the paper, Algorithm
// 1 (visibility).

/// Colour masks and point depth buffers of `occluders` (occluding_points()) for the cameras whose
/// frames have pixels, sorted by name. Frames and models stay borrowed.
std::vector<VertexCamera> vertex_cameras(const PointArrays& occluders,
                                         std::vector<TextureCamera> cameras,
                                         const TextureOptions& options);

// The colours of a mesh in each camera, before blending. A renderer elsewhere needs them for
// view-dependent texture.

/// Visibility of a vertex in a camera, as in colour_vertices().
enum class Visibility : uint8_t {
  kNone = 0,
  kRim = 128,  ///< at the rim of the silhouette: the colour may contain background
  kFull = 255
};

struct CameraColours {
  std::string camera;
  /// One entry per vertex: red, green, blue, corrected by the ColourResponse, and a Visibility. All
  /// 0 for a vertex that the camera does not see.
  std::vector<std::array<uint8_t, 4>> vertices;
};

/// One entry per camera, sorted by name. A camera whose frame has no pixels sees nothing.
/// options.view and options.fill_passes are ignored. Deterministic: independent of thread count.
std::vector<CameraColours> camera_colours(const Mesh& mesh, std::span<const TextureCamera> cameras,
                                          const TextureOptions& options);

// Colours of a mesh for a viewpoint from the views of cameras that a compact frame has.

/// `colours`, one entry for each camera, as views of a compact frame. A vertex at the rim of a
/// silhouette, where the colour may be that of the background, is seen only if no camera sees it
/// elsewhere (Visibility::kFull). Requires the cameras in `rig`.
std::vector<codec::CameraView> camera_views(std::span<const CameraColours> colours, const Rig& rig);

/// View-dependent colours: the mean over the cameras that see a vertex, with the weights of
/// Algorithm 2, equation (7). A vertex that no camera sees keeps its entry of `colours`. Requires
/// views of all vertices.
std::vector<Rgb8> blended_views(std::span<const Rgb8> colours,
                                std::span<const codec::CameraView> views,
                                const ViewDependence& eye);

}  // namespace v3d::recon
