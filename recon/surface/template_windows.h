// The template windows of vertices: which cameras look at each, and where the window falls in their
// pictures.
#pragma once

#include <span>
#include <vector>

#include "recon/surface/correlation.h"
#include "recon/visibility/vertex_visibility.h"

namespace v3d {

/// Windows tangent to the surface.
struct WindowOptions {
  int level = 0;        ///< of SurfaceCamera::picture()
  int max_views = 6;    ///< at most kMaxWindowViews
  size_t every = 1;     ///< only so many-th vertex of a block has a window
  float spacing_m = 0;  ///< between two samples
  float step_m = 0;     ///< between two depths of a profile
};

/// The windows of a block of vertices. Keeps its memory.
class WindowBlock {
 public:
  /// `sights`: one per camera, of the vertices at `places` with these normals (unit length), no
  /// more than VertexVisibility::kCapacity. Of every vertex: the cameras that see it, those that it
  /// faces most first: the paper's C_v, c_m at the front. A camera in which part of the window
  /// would leave the picture is left out. None where the window's corners leave the silhouette of
  /// the first, at an outline or on what is slenderer than the window: the background would be
  /// compared.
  void find(std::span<const Eigen::Vector3f> places, std::span<const Eigen::Vector3f> normals,
            std::span<const SurfaceCamera> cameras, std::span<const VertexVisibility> visibilities,
            const WindowOptions& options, const CorrelationOptions& correlation);

  /// Those of a vertex of the block.
  const WindowViews& views(size_t i) const { return views_[i]; }

 private:
  /// A camera that sees the middle of a window, and the pixels beside it, one step along each axis.
  struct Candidate {
    float facing = 0;
    uint32_t camera = 0;
    Eigen::Vector2f across, down, out;
  };
  struct Candidates {
    int count = 0;
    std::array<Candidate, kMaxWindowViews> list;
  };
  /// A vertex of the block, and its candidate that is a certain camera.
  struct Observer {
    size_t vertex;
    Candidate* candidate;
  };
  void choose_cameras(size_t i, std::span<const VertexVisibility> visibilities, int most);
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

/// What they see of it, and where its windows fall in their pictures. Keeps its memory; one to a
/// thread.
class BlockVisibility {
 public:
  /// `places` and `normals` (unit length) of VertexVisibility::kCapacity vertices at most, world,
  /// metres. `depths` are of the mesh, one per camera.
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

  /// One per camera, of the last look().
  std::span<const VertexVisibility> by_camera() const { return by_camera_; }

  WindowBlock windows;  ///< to be found from sights()

 private:
  PointBlock places_, normals_;
  std::vector<VertexVisibility> by_camera_;
};

}  // namespace v3d
