// Template windows and their correlation.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "recon/visibility/surface_camera.h"
#include "recon/visibility/vertex_visibility.h"

namespace v3d::recon {

// Photo-consistency of a surface element: normalised cross-correlation of template windows between
// cameras, at 16 depths at once. Source: equations (4) and (5) of the paper.

/// Projection of a template window into one camera, linearised in the two axes of the window and in
/// the depth along the normal. Pixels of `image`; (0, 0) is the centre of its first pixel.
struct WindowView {
  const Luminance* image = nullptr;
  float u = 0, v = 0;                ///< of the window's centre
  float u_across = 0, v_across = 0;  ///< for one step of the window along its first axis
  float u_down = 0, v_down = 0;      ///< the second axis
  float u_out = 0, v_out = 0;        ///< for one step along the normal
};

inline constexpr int kMaxWindowViews = 8;
inline constexpr int kMaxWindowSide = 11;
inline constexpr int kDepthSteps = 16;

/// Correlation at kDepthSteps depths; entry k is at `first` + k steps along the normal.
using DepthProfile = std::array<float, kDepthSteps>;

struct WindowViews {
  int count = 0;
  std::array<WindowView, kMaxWindowViews> view;    ///< the first is the reference camera
  std::array<uint32_t, kMaxWindowViews> camera{};  ///< index of each camera
};

struct CorrelationOptions {
  int side = 7;        ///< samples along each axis of the window; odd, at most kMaxWindowSide
  float first = -8;    ///< steps along the normal at which a profile begins
  float noise = 1;     ///< variance of image noise, squared grey values
  bool robust = true;  ///< negative correlations count as 0
};

/// Agreement of any two cameras at each depth, without a reference camera.
struct PairAgreement {
  /// Mean of the correlations of the two pairs that agree best; negative ones count as 0.
  DepthProfile score{};
  /// One bit per view: set where it correlates with another view by `min_correlation` or more.
  std::array<uint8_t, kDepthSteps> agreeing{};
};

/// True when every sample of the window, at every depth, lies inside the image.
bool window_fits(const WindowView& view, const CorrelationOptions& options);

/// Mean normalised cross-correlation of each further view with the first, at kDepthSteps depths
/// along the normal.
///
/// Requires at least two views, all of them window_fits(). Vectorised by run-time dispatch; every
/// instruction set gives the same bits.
void correlate(const WindowViews& views, const CorrelationOptions& options, DepthProfile& profile);

/// Correlation of every pair of views, without a reference camera. `min_correlation`: see
/// PairAgreement::agreeing. Requirements as for correlate(); `robust` is ignored.
void correlate_pairs(const WindowViews& views, const CorrelationOptions& options,
                     float min_correlation, PairAgreement& agreement);

// Template windows: samples on the tangent planes of vertices, and their projections into the
// cameras that see the vertices.

/// Windows lie in the tangent plane of the surface.
struct WindowOptions {
  int level = 0;        ///< of SurfaceCamera::picture()
  int max_views = 6;    ///< at most kMaxWindowViews
  size_t every = 1;     ///< every n-th vertex of a block has a window
  float spacing_m = 0;  ///< between two samples
  float step_m = 0;     ///< between two depths of a profile
};

/// The windows of a block of vertices. Keeps its memory. One thread.
class WindowBlock {
 public:
  /// For each vertex, the cameras that see it, most frontal first: C_v of the paper, with c_m at
  /// the front.
  ///
  /// `visibilities` has one entry per camera, for the vertices at `positions` (world, metres) with
  /// unit `normals`, at most VertexVisibility::kCapacity. A camera is left out when part of the
  /// window would lie outside its image. A vertex has no window when corners lie outside the
  /// silhouette of its first camera, at an outline or on a thin part: background would be compared.
  void find(std::span<const Eigen::Vector3f> positions, std::span<const Eigen::Vector3f> normals,
            std::span<const SurfaceCamera> cameras, std::span<const VertexVisibility> visibilities,
            const WindowOptions& options, const CorrelationOptions& correlation);

  /// The views of the i-th vertex of the block.
  const WindowViews& views(size_t i) const { return views_[i]; }

 private:
  /// A camera that sees the centre of a window: the pixels of one step along each axis.
  struct Candidate {
    float facing = 0;
    uint32_t camera = 0;
    Eigen::Vector2f across, down, out;
  };
  struct Candidates {
    int count = 0;
    std::array<Candidate, kMaxWindowViews> list;
  };
  /// An entry of a camera's list: a vertex of the block, and its candidate for this camera.
  struct Observer {
    size_t vertex;
    Candidate* candidate;
  };
  void choose_cameras(size_t i, std::span<const VertexVisibility> visibilities, int max_views);
  void list_observers(std::span<const Eigen::Vector3f> normals, const WindowOptions& options,
                      size_t cameras);
  void project_axes(std::span<const Eigen::Vector3f> positions,
                    std::span<const Eigen::Vector3f> normals, const SurfaceCamera& camera,
                    std::span<const Observer> observers, const WindowOptions& options);
  void make_views(size_t i, std::span<const SurfaceCamera> cameras,
                  std::span<const VertexVisibility> visibilities, const WindowOptions& options,
                  const CorrelationOptions& correlation);

  std::array<Candidates, VertexVisibility::kCapacity> candidates_;
  std::array<Eigen::Vector3f, VertexVisibility::kCapacity>
      across_;                                    ///< the windows' first axes, one step
  std::vector<std::vector<Observer>> observers_;  ///< by camera
  std::array<WindowViews, VertexVisibility::kCapacity> views_;
};

/// Visibility of a block of vertices in all cameras, and the windows of the block. Keeps its
/// memory; one object per thread.
class BlockVisibility {
 public:
  /// `positions` (world, metres) and unit `normals` of at most VertexVisibility::kCapacity
  /// vertices. `depths` has the depth buffer of the mesh in each camera.
  void compute(std::span<const Eigen::Vector3f> positions, std::span<const Eigen::Vector3f> normals,
               std::span<const SurfaceCamera> cameras, std::span<const DepthBuffer> depths,
               const VisibilityOptions& options) {
    positions_.count = positions.size();
    for (size_t i = 0; i < positions.size(); ++i) {
      positions_.set(i, positions[i]);
      normals_.set(i, normals[i]);
    }
    by_camera_.resize(cameras.size());
    for (size_t c = 0; c < cameras.size(); ++c) {
      test_visibility(cameras[c], depths[c], positions_, normals_, options, by_camera_[c]);
    }
  }

  /// One entry per camera, of the last compute().
  std::span<const VertexVisibility> by_camera() const { return by_camera_; }

  WindowBlock windows;  ///< call find() with by_camera()

 private:
  PointBlock positions_, normals_;
  std::vector<VertexVisibility> by_camera_;
};

}  // namespace v3d::recon
