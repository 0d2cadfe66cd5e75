// Template windows: samples on the tangent planes of vertices, and their projections into the
// cameras that see the vertices.
#pragma once

#include <span>
#include <vector>

#include "recon/surface/correlation.h"
#include "recon/visibility/vertex_visibility.h"

namespace v3d {

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
  /// `visibilities` has one entry per camera, for the vertices at `places` (world, metres) with
  /// unit `normals`, at most VertexVisibility::kCapacity. A camera is left out when part of the
  /// window would lie outside its image. A vertex has no window when corners lie outside the
  /// silhouette of its first camera, at an outline or on a thin part: background would be compared.
  void find(std::span<const Eigen::Vector3f> places, std::span<const Eigen::Vector3f> normals,
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
  void project_axes(std::span<const Eigen::Vector3f> places,
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
  /// `places` (world, metres) and unit `normals` of at most VertexVisibility::kCapacity vertices.
  /// `depths` has the depth buffer of the mesh in each camera.
  void compute(std::span<const Eigen::Vector3f> places, std::span<const Eigen::Vector3f> normals,
               std::span<const SurfaceCamera> cameras, std::span<const DepthBuffer> depths,
               const VisibilityOptions& options) {
    places_.count = places.size();
    for (size_t i = 0; i < places.size(); ++i) {
      places_.set(i, places[i]);
      normals_.set(i, normals[i]);
    }
    by_camera_.resize(cameras.size());
    for (size_t c = 0; c < cameras.size(); ++c) {
      test_visibility(cameras[c], depths[c], places_, normals_, options, by_camera_[c]);
    }
  }

  /// One entry per camera, of the last compute().
  std::span<const VertexVisibility> by_camera() const { return by_camera_; }

  WindowBlock windows;  ///< call find() with by_camera()

 private:
  PointBlock places_, normals_;
  std::vector<VertexVisibility> by_camera_;
};

}  // namespace v3d
