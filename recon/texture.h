// One colour for every vertex: the paper's Algorithm 1 (visibility), equations (8) and (9)
// (weights).
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

/// The same in whole-image coordinates: `frame.image` covers only frame.roi. Empty outside the roi
/// and where the frame's mask (if it has one) is background.
std::optional<Eigen::Vector3f> sample_colour(const Frame& frame, double u, double v);

/// Whether the pixels that such a sample is made of may show background: one of the pixels two
/// steps left, right, above or below is background in the mask. False without a mask.
bool touches_background(const Frame& frame, double u, double v);

/// What colours the mesh: both borrowed. Requires frame->sensor_size == model->size().
struct TextureCamera {
  const CameraModel* model = nullptr;
  const Frame* frame = nullptr;
};

struct TextureOptions {
  /// A vertex is occluded when the depth buffer is nearer than it by more than this, metres. About
  /// two voxels: the surface is not known better.
  double depth_tolerance_m = 0.02;
  /// A surface at a slant changes its depth within a pixel of the depth buffer; the tolerance grows
  /// by that, but by no more than so many widths of a pixel.
  double most_slant = 6;
  int depth_reduction = 2;  ///< the depth buffer has 1/so many of the camera's columns and rows
  int fill_passes = 64;     ///< how far colour spreads to vertices that no camera sees, in edges
};

/// A vertex no camera sees and no fill pass reaches.
inline constexpr Rgb8 kUnseenColour{128, 128, 128};

struct Texture {
  std::vector<Rgb8> colours;  ///< one per vertex
  int64_t unseen = 0;         ///< vertices that no camera sees
};

/// Vertex v is visible in camera c when its normal faces the camera (V_c . N_v < 0 with V_c the
/// optical axis), the depth buffer shows nothing before it, and sample_colour() finds a pixel. Its
/// colour is the mean over those cameras, weighted by -V_c . N_v. Beyond the paper, a camera in
/// which the vertex touches_background() counts only where no other sees it: else the studio's
/// walls would colour the rim of every silhouette. Vertices that no camera sees take the mean
/// colour of their neighbours, pass by pass. Deterministic for any number of threads and any order
/// of `cameras` (they are taken in the order of their names, which must differ).
Texture colour_vertices(const Mesh& mesh, std::span<const TextureCamera> cameras,
                        const TextureOptions& options);

}  // namespace v3d
