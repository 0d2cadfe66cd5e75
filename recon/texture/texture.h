// One colour for every vertex: the paper's Algorithm 1 (visibility), with the weights of equations
// (8) and (9), or for one viewpoint with those of Algorithm 2 and equation (7).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "base/camera_model.h"
#include "base/frame.h"
#include "base/mesh.h"

namespace v3d {

/// The colour of an image between its pixels: R, G, B in grey values 0 to 255. (u, v) are pixel
/// coordinates (centre of the first pixel: 0, 0); the image is mirrored at its borders, empty
/// outside. A Bayer image is not demosaiced: each colour is bilinear on its own lattice, red and
/// blue with a spacing of 2 pixels, green on the quincunx (the bilinear cell is a diamond round the
/// point).
std::optional<Eigen::Vector3f> sample_colour(ImageView image, double u, double v);

/// What colours the mesh: borrowed. Requires frame->sensor_size == model->size().
struct TextureCamera {
  const CameraModel* model = nullptr;
  const Frame* frame = nullptr;
  const ColourResponse* colour = nullptr;  ///< null: its colours are taken as they are
};

/// A viewpoint as Algorithm 2 knows it.
struct ViewDependence {
  Eigen::Vector3d direction;  ///< V_eye: unit vector of its optical axis, world
  double sharpness = 10;      ///< m; the paper's value
};

struct TextureOptions {
  /// A vertex is occluded when the depth cells are nearer than it by more than this, metres. About
  /// three voxels: the surface is known to one, and the points that hide stand for surroundings.
  double depth_tolerance_m = 0.03;
  /// What hides is known to a few widths of a depth cell (see PointDepthBuffer), and a surface at a
  /// slant changes its depth within that: the tolerance grows by it, but by no more than so many
  /// widths.
  double max_slant = 6;
  /// The surface hides what lies behind it through points no farther apart than this lets
  /// (see occluding_points()); depth cells are as wide. 0.71 voxels: the vertices alone.
  double occluder_radius_m = 0.0071;
  /// Pictures of a filter mosaic are demosaiced whole before they are sampled, which shows finer
  /// detail than each colour on its own lattice and costs a pass over the pixels of every roi.
  bool demosaic = false;
  /// A camera counts by the square of its resolution on the surface, along the slant: -V_c . N_v
  /// times focal length over depth. (Not of the paper, where distance does not count.)
  bool by_resolution = false;
  int fill_passes = 64;  ///< how far colour spreads to vertices that no camera sees, in edges
  /// Colours for this viewpoint alone: a camera counts the more, the more it looks the same way.
  std::optional<ViewDependence> view = std::nullopt;
};

/// A vertex no camera sees and no fill pass reaches.
inline constexpr Rgb8 kUnseenColour{128, 128, 128};

struct Texture {
  std::vector<Rgb8> colours;  ///< one per vertex
  int64_t unseen = 0;         ///< vertices that no camera sees
};

/// Vertex v is visible in camera c when its normal faces the camera (V_c . N_v < 0 with V_c the
/// optical axis), the depth cells show nothing before it, and sample_colour() finds a pixel. Its
/// colour, every sample corrected by the camera's ColourResponse, is the mean over those cameras,
/// weighted by -V_c . N_v or by_resolution, or, for a viewpoint, by (V_eye . V_c + 2)^m, which is
/// the same for all vertices. Beyond the paper, a camera in which the vertex is not
/// ColourMask::inner() counts only where no other sees it: else the studio's walls would colour the
/// rim of every silhouette. Vertices that no camera sees take the mean colour of their neighbours,
/// pass by pass. Deterministic for any number of threads and any order of `cameras` (they are taken
/// in the order of their names, which must differ).
Texture colour_vertices(const Mesh& mesh, std::span<const TextureCamera> cameras,
                        const TextureOptions& options);

}  // namespace v3d
