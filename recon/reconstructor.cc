#include "recon/reconstructor.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/time.h"
#include "recon/compact_frame.h"
#include "recon/intersect.h"
#include "recon/marching_cubes.h"
#include "recon/steady_surface.h"
#include "recon/texture.h"

namespace v3d {
namespace {

/// The surface is known to about a voxel on either side, and the points that hide it stand for
/// their surroundings.
constexpr double kDepthToleranceVoxels = 3;

/// Half of the longest edge of a marching cube, which joins the middles of two edges of a voxel.
constexpr double kTriangleRadiusVoxels = 0.71;

/// Milliseconds since it was made.
class Stopwatch {
 public:
  double ms() const { return 1000 * to_seconds(Monotonic::now() - start_); }

 private:
  MonotonicInstant start_ = Monotonic::now();
};

VoxelGrid affordable_grid(const ReconstructOptions& options) {
  const VoxelGrid grid = VoxelGrid::covering(options.bounds, options.voxel_m);
  require_memory(grid, static_cast<double>(available_memory()));
  return grid;
}

/// Half voxels for the discrete marching cubes. A deformed surface gets the finest fraction of them
/// with which 65536 steps reach through the grid: 0.08 mm for 3 m at 5 mm.
VertexLattice lattice_of(const VoxelGrid& grid, Quality quality) {
  VertexLattice lattice{grid.origin, grid.voxel_m / 2};
  int64_t steps = 2 * *std::ranges::max_element(grid.counts);
  while (quality == Quality::kHigh && 2 * steps <= 0xFFFF) {
    lattice.step /= 2;
    steps *= 2;
  }
  return lattice;
}

std::optional<Deformer> deformer_of(const ReconstructOptions& options,
                                    const VertexLattice& lattice) {
  if (options.quality != Quality::kHigh) return std::nullopt;
  DeformOptions deform = options.deform;
  deform.voxel_m = options.voxel_m;
  deform.lattice = lattice;
  check(deform);
  return std::optional<Deformer>(std::in_place, deform);
}

int arena_size(int threads) { return threads > 0 ? threads : tbb::task_arena::automatic; }

}  // namespace

class Reconstructor::Impl {
 public:
  Impl(const Rig& rig, const ReconstructOptions& options)
      : rig_(rig),
        models_(models_of(rig)),
        grid_(affordable_grid(options)),
        lattice_(lattice_of(grid_, options.quality)),
        deformer_(deformer_of(options, lattice_)),
        arena_(arena_size(options.threads)),
        quality_(
            arena_.execute([&] { return QualityMeter(rig, options.bounds, options.voxel_m); })),
        intersector_(grid_, models_, options.min_views) {}

  Reconstruction reconstruct(FrameSet set) {
    SetAtWork work(std::move(set));
    arena_.execute([&] {
      make_mesh(work);
      encode(work);
    });
    return std::move(work.result);
  }

  void make_mesh(SetAtWork& work) {
    make_surface(work);
    make_colours(work);
  }

  void make_surface(SetAtWork& work) {
    work.result.pulse = work.set.pulse;
    work.frames = usable_frames(work.set);
    shape(work);
    if (deformer_) deform(work);
  }

  Moment moment_of(const SetAtWork& work) const { return {models_, work.frames, work.result.mesh}; }

  void steady(SetAtWork& work, const Moment& now, std::span<const Moment* const> beside) const {
    const Stopwatch steadying;
    steady_surface(now, beside, {.voxel_m = grid_.voxel_m, .lattice = lattice_}, work.result.mesh);
    work.result.times.steady = steadying.ms();
  }

  void make_colours(SetAtWork& work) const {
    const Stopwatch texturing;
    Reconstruction& result = work.result;
    std::vector<TextureCamera> cameras;
    for (size_t c = 0; c < work.frames.size(); ++c) {
      if (work.frames[c] != nullptr) {
        cameras.push_back({&rig_[c].model, work.frames[c], &rig_[c].colour});
        result.cameras.push_back(rig_[c].name);
      }
    }
    std::sort(result.cameras.begin(), result.cameras.end());
    const TextureOptions options{.depth_tolerance_m = kDepthToleranceVoxels * grid_.voxel_m,
                                 .occluder_radius_m = kTriangleRadiusVoxels * grid_.voxel_m};
    result.mesh.colours = colour_vertices(result.mesh, cameras, options).colours;
    result.times.texture = texturing.ms();
  }

  void encode(SetAtWork& work) const {
    const Stopwatch encoding;
    Reconstruction& result = work.result;
    CompactFrame frame;
    frame.pulse = result.pulse;
    frame.exposure = work.set.exposure;
    frame.cameras = result.cameras;
    frame.missing = static_cast<int>(rig_.size() - result.cameras.size());
    frame.lattice = lattice_;
    std::swap(frame.mesh, result.mesh);
    result.compact = encode_compact(frame);
    std::swap(frame.mesh, result.mesh);
    result.times.encode = encoding.ms();
    const Stopwatch judging;
    result.quality = quality_.measure(result.mesh, work.frames);
    result.times.quality = judging.ms();
  }

 private:
  void shape(SetAtWork& work) {
    Reconstruction& result = work.result;
    const Stopwatch intersecting;
    std::vector<const Mask*> masks;
    masks.reserve(work.frames.size());
    for (const Frame* frame : work.frames) {
      masks.push_back(frame != nullptr ? &*frame->mask : nullptr);
    }
    intersector_.intersect(masks, volume_);
    result.volume_m3 = static_cast<double>(volume_.count()) * grid_.voxel_volume_m3();
    result.times.intersect = intersecting.ms();

    const Stopwatch meshing;
    // The order of the compact frame: so the mesh here is the one that every receiver decodes.
    marching_cubes_.run(volume_, result.mesh);
    result.mesh = in_coding_order(std::move(result.mesh));
    result.times.mesh = meshing.ms();
  }

  void deform(SetAtWork& work) {
    const Stopwatch deforming;
    std::vector<DeformCamera> cameras;
    for (size_t c = 0; c < work.frames.size(); ++c) {
      if (work.frames[c] != nullptr) cameras.push_back({&rig_[c].model, work.frames[c]});
    }
    deformer_->run(cameras, work.result.mesh);
    work.result.times.deform = deforming.ms();
  }

  /// The frame of each camera of the rig; null where it has none that can be used.
  std::vector<const Frame*> usable_frames(const FrameSet& set) const {
    std::vector<const Frame*> frames(rig_.size(), nullptr);
    for (const Frame& frame : set.frames) {
      const int c = find_camera(rig_, frame.camera);
      if (c >= 0 && frame.mask && frame.mask->size() == rig_[c].model.size() &&
          frame.image.size == ImageSize{frame.roi.width, frame.roi.height}) {
        frames[c] = &frame;
      }
    }
    return frames;
  }

  const Rig rig_;
  const std::vector<CameraModel> models_;
  const VoxelGrid grid_;
  const VertexLattice lattice_;       ///< of the compact frames
  std::optional<Deformer> deformer_;  ///< for Quality::kHigh
  tbb::task_arena arena_;             ///< reconstruct()
  const QualityMeter quality_;
  // What make_mesh() works with, and keeps.
  Intersector intersector_;
  SparseVolume volume_;
  MarchingCubes marching_cubes_;
};

Reconstructor::Reconstructor(const Rig& rig, const ReconstructOptions& options)
    : impl_(std::make_unique<Impl>(rig, options)) {}
Reconstructor::~Reconstructor() = default;

Reconstruction Reconstructor::reconstruct(FrameSet set) {
  return impl_->reconstruct(std::move(set));
}
void Reconstructor::make_mesh(SetAtWork& work) { impl_->make_mesh(work); }
void Reconstructor::encode(SetAtWork& work) const { impl_->encode(work); }
void Reconstructor::make_surface(SetAtWork& work) { impl_->make_surface(work); }
Moment Reconstructor::moment_of(const SetAtWork& work) const { return impl_->moment_of(work); }
void Reconstructor::steady(SetAtWork& work, const Moment& now,
                           std::span<const Moment* const> beside) const {
  impl_->steady(work, now, beside);
}
void Reconstructor::make_colours(SetAtWork& work) const { impl_->make_colours(work); }

}  // namespace v3d
