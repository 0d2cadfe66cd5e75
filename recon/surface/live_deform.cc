#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "base/core/error.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/mesh/self_intersection.h"
#include "recon/surface/deform.h"
#include "recon/surface/displacement_field.h"
#include "recon/surface/template_windows.h"
#include "recon/visibility/vertex_visibility.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

/// Resolution and range of a depth search. Lengths in voxels.
struct Search {
  int level;      ///< of the images
  float spacing;  ///< between samples of the template window
  float step;     ///< between depths
  float first;    ///< steps; negative is inwards, where the surface must lie
  bool outlines;  ///< Silhouettes pull. Not on a hull, most of which lies on outlines.
};
constexpr Search kCoarse{1, 1.5F, 0.6F, -11, false}, kFine{0, 1.0F, 0.3F, -8, true};

// The cost of a search is proportional to windows times samples times cameras.
constexpr size_t kEvery = 4;  ///< every n-th vertex has a template window
constexpr int kSide = 3;      ///< of the window, samples
constexpr int kMaxViews = 6;  ///< cameras that take part in a correlation

constexpr float kNoiseVariance = 2;  ///< squared grey values
constexpr int kSweeps = 4;           ///< of the displacement field
constexpr int kSmoothingBefore = 2, kSmoothingAfter = 1, kNormalSmoothing = 2;

/// Weight of the pull to the position before the search; a clear depth has about 0.3. Without it,
/// the field would carry vertices without a window inwards, off their silhouettes.
constexpr float kHold = 0.005F;
/// Weight of the pull to the observed outline, for each camera in which a vertex lies on the
/// outline of the mesh.
constexpr float kOutlinePull = 0.06F;
/// Free voxels beyond such a vertex. Depth buffers enlarge the mesh by up to 1.5.
constexpr float kClear = 2.5F;

/// Depth tolerance of the visibility test, voxels, without the slant.
constexpr float kHiddenBehind = 1.5F;
/// Half of the longest edge of a marching cubes triangle, voxels.
constexpr double kTriangleRadius = 0.71;

/// A block of windows; one object per thread.
struct Block {
  std::array<Vector3f, VertexVisibility::kCapacity> positions, normals;
  PointBlock position_block, normal_block;
  std::vector<VertexVisibility> by_camera;
  WindowBlock windows;
};

}  // namespace

class LiveDeformer::Impl {
 public:
  explicit Impl(const LiveDeformOptions& options)
      : options_(options), voxel_(static_cast<float>(options.voxel_m)) {}

  int run(const SurfaceCameras& cameras, int passes, Mesh& mesh, const PassCheck& may_run) {
    V3D_CHECK(passes >= 0 && passes <= kLivePasses);
    if (passes == 0 || cameras.cameras.empty() || mesh.vertices.empty()) return passes;
    int done = 1;
    const auto runs = [&](LivePass pass) {
      const bool is_next = done == static_cast<int>(pass) && done < passes;
      if (!is_next || (may_run && !may_run())) return false;
      ++done;
      return true;
    };
    neighbours_ = Neighbours(mesh);
    rows_ = NeighbourRows(neighbours_);
    start_ = mesh.vertices;
    smooth_surface(neighbours_, kSmoothingBefore, mesh.vertices, work_);
    search(kCoarse, cameras, mesh);
    if (runs(LivePass::kFine)) search(kFine, cameras, mesh);
    if (runs(LivePass::kCrossings)) {
      remove_self_intersections(neighbours_, start_, options_.lattice, mesh);
    } else {
      for_each_vertex(mesh.vertices.size(), [&](size_t v) {
        mesh.vertices[v] = rounded_to(options_.lattice, mesh.vertices[v]);
      });
    }
    return done;
  }

 private:
  void search(const Search& search, const SurfaceCameras& cameras, Mesh& mesh) {
    if (search.outlines) find_outlines(cameras.cameras);
    observe(search, cameras, mesh);
    const std::span<const float> way =
        field_.solve(rows_, profiles_, known_, pulls_,
                     {.first = search.first, .step_m = search.step * voxel_, .sweeps = kSweeps});
    for_each_vertex(way.size(), [&](size_t v) { mesh.vertices[v] += way[v] * normals_[v]; });
    smooth_surface(neighbours_, kSmoothingAfter, mesh.vertices, work_);
  }

  /// Correlates the windows of every kEvery-th vertex.
  void observe(const Search& search, const SurfaceCameras& cameras, const Mesh& mesh) {
    const size_t count = mesh.vertices.size();
    tbb::parallel_invoke(
        [&] {
          normals_ = vertex_normals(mesh);
          smooth_normals(neighbours_, kNormalSmoothing, normals_, work_);
        },
        [&] { draw_depths(cameras, mesh); });
    profiles_.resize(count);
    known_.assign(count, 0);
    pulls_.assign(count, {.weight = kHold, .sum_m = 0});
    tbb::enumerable_thread_specific<Block> of_threads;
    for_each_block<VertexVisibility::kCapacity>(
        (count + kEvery - 1) / kEvery, [&](size_t begin, size_t end) {
          correlate_block(search, cameras.cameras, mesh, begin, end, of_threads.local());
        });
  }

  void draw_depths(const SurfaceCameras& cameras, const Mesh& mesh) {
    const double radius_m = kTriangleRadius * options_.voxel_m;
    const PointArrays points(occluding_points(mesh, radius_m));
    const Vector3f middle = vertex_centroid(mesh);
    depths_.resize(cameras.cameras.size());
    tbb::parallel_for(size_t{0}, depths_.size(), [&](size_t c) {
      const SurfaceCamera& camera = cameras.cameras[c];
      const Rect box = camera.silhouette().bounding_box();
      depths_[c] = box.empty() ? PointDepthBuffer()
                               : PointDepthBuffer(points, middle, radius_m, cameras.models[c],
                                                  camera.lens(), box);
    });
  }

  void find_outlines(std::span<const SurfaceCamera> cameras) {
    near_.resize(cameras.size());
    tbb::parallel_for(size_t{0}, near_.size(),
                      [&](size_t c) { near_[c] = near_silhouette_outline(cameras[c]); });
  }

  /// Whether no surface lies beyond the position in the direction of its normal, seen from the
  /// camera: the position is on the outline of the mesh.
  bool is_on_outline(const SurfaceCamera& camera, const PointDepthBuffer& depth,
                     const Vector3f& position, const Vector3f& normal) const {
    const auto beyond = camera.project(position + kClear * voxel_ * normal);
    if (!beyond) return false;
    const CellGrid& grid = depth.grid();
    const auto column = static_cast<int>((beyond->pixel.x() - grid.first_u) * grid.cells_per_pixel);
    const auto row = static_cast<int>((beyond->pixel.y() - grid.first_v) * grid.cells_per_pixel);
    if (column <= 0 || row <= 0 || column >= grid.columns - 1 || row >= grid.rows - 1) return true;
    return std::isinf(depth.nearest()[row * grid.columns + column]);
  }

  /// Pulls the vertices with windows `begin` and following to the outlines on which they lie.
  void pull_to_outlines(std::span<const SurfaceCamera> cameras, size_t begin, const Block& block) {
    for (size_t c = 0; c < cameras.size(); ++c) {
      const VertexBits on_outline = grazing_vertices(near_[c], block.by_camera[c],
                                                     block.position_block.count, kMaxOutlineFacing);
      for_each_bit(on_outline, [&](size_t i) {
        if (!is_on_outline(cameras[c], depths_[c], block.positions[i], block.normals[i])) return;
        const auto way = displacement_to_silhouette(cameras[c], block.positions[i],
                                                    block.normals[i], block.by_camera[c].at(i));
        if (!way) return;
        OutlinePull& pull = pulls_[kEvery * (begin + i)];
        pull.weight += kOutlinePull;
        pull.sum_m += kOutlinePull * *way;
      });
    }
  }

  /// Windows `begin` to `end` - 1.
  void correlate_block(const Search& search, std::span<const SurfaceCamera> cameras,
                       const Mesh& mesh, size_t begin, size_t end, Block& block) {
    const size_t count = end - begin;
    block.position_block.count = count;
    for (size_t i = 0; i < count; ++i) {
      block.positions[i] = mesh.vertices[kEvery * (begin + i)];
      block.normals[i] = normals_[kEvery * (begin + i)];
      block.position_block.set(i, block.positions[i]);
      block.normal_block.set(i, block.normals[i]);
    }
    block.by_camera.resize(cameras.size());
    for (size_t c = 0; c < cameras.size(); ++c) {
      test_cell_visibility(cameras[c], depths_[c], block.position_block, block.normal_block,
                           {.tolerance_m = kHiddenBehind * voxel_}, block.by_camera[c]);
    }
    if (search.outlines) pull_to_outlines(cameras, begin, block);
    const CorrelationOptions correlation{
        .side = kSide, .first = search.first, .noise = kNoiseVariance};
    block.windows.find(std::span(block.positions).first(count),
                       std::span(block.normals).first(count), cameras, block.by_camera,
                       {.level = search.level,
                        .max_views = kMaxViews,
                        .spacing_m = search.spacing * voxel_,
                        .step_m = search.step * voxel_},
                       correlation);
    for (size_t i = 0; i < count; ++i) {
      const WindowViews& views = block.windows.views(i);
      if (views.count < 2) continue;
      const size_t vertex = kEvery * (begin + i);
      correlate(views, correlation, profiles_[vertex]);
      known_[vertex] = 1;
    }
  }

  const LiveDeformOptions options_;
  const float voxel_;
  std::vector<PointDepthBuffer> depths_;  ///< by camera
  std::vector<Mask> near_;                ///< near_silhouette_outline(), by camera
  Neighbours neighbours_;
  NeighbourRows rows_;  ///< the same for field_
  std::vector<Vector3f> start_, normals_, work_;
  std::vector<DepthProfile> profiles_;
  std::vector<uint8_t> known_;  ///< 1 where a vertex has a profile
  std::vector<OutlinePull> pulls_;
  DisplacementField field_;
};

LiveDeformer::LiveDeformer(const LiveDeformOptions& options)
    : impl_(std::make_unique<Impl>(options)) {}
LiveDeformer::~LiveDeformer() = default;
int LiveDeformer::run(const SurfaceCameras& cameras, int passes, Mesh& mesh,
                      const PassCheck& may_run) {
  return impl_->run(cameras, passes, mesh, may_run);
}

}  // namespace v3d::recon
