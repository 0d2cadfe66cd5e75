#include "recon/pipeline/reconstructor.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <utility>

#include "base/core/error.h"
#include "base/core/memory.h"
#include "base/core/time.h"
#include "recon/hull/ghost_removal.h"
#include "recon/hull/intersect.h"
#include "recon/hull/marching_cubes.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/surface/concavity_carving.h"
#include "recon/surface/temporal_smoothing.h"
#include "recon/texture/texture.h"

namespace v3d {
namespace {

/// The surface is accurate to about one voxel in both directions, and occluding points represent
/// their surroundings.
constexpr double kDepthToleranceVoxels = 3;

/// Half of the longest edge of a marching cubes triangle, which connects the middles of two voxel
/// edges.
constexpr double kTriangleRadiusVoxels = 0.71;

/// Milliseconds since construction.
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

/// Deformed surfaces are quantised to a fiftieth of a voxel, which is less than their flicker.
/// docs/deformation.md compares other steps.
constexpr int kStepsInHalfVoxel = 25;

/// The lattice of the vertices. Discrete marching cubes have half-voxel steps.
VertexLattice lattice_of(const VoxelGrid& grid, Quality quality) {
  const double half_voxel = grid.voxel_m / 2;
  return {grid.origin, quality == Quality::kHigh ? half_voxel / kStepsInHalfVoxel : half_voxel};
}

EncoderOptions encoder_options(const VertexLattice& lattice) {
  EncoderOptions options;
  options.displacement_step_m = lattice.step;
  return options;
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

std::optional<ConcavityCarver> carver_of(const ReconstructOptions& options) {
  const DeformOptions& deform = options.deform;
  const bool wanted = options.quality == Quality::kHigh && deform.carve_concavities &&
                      deform.mode == DeformMode::kSearch && deform.photometric > 0;
  return wanted ? std::optional<ConcavityCarver>(std::in_place) : std::nullopt;
}

double volume_m3(const SparseVolume& volume) {
  return static_cast<double>(volume.count()) * volume.grid().voxel_volume_m3();
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
        carver_(carver_of(options)),
        arena_(arena_size(options.threads)),
        quality_(
            arena_.execute([&] { return QualityMeter(rig, options.bounds, options.voxel_m); })),
        intersector_(grid_, models_, options.min_views),
        ghosts_(grid_, models_),
        encoder_(encoder_options(lattice_)) {}

  Reconstruction reconstruct(FrameSet set) {
    FrameSetJob work(std::move(set));
    begin_sequence();
    arena_.execute([&] {
      make_mesh(work);
      encode(work);
    });
    return std::move(work.result);
  }

  void make_mesh(FrameSetJob& work) {
    make_surface(work);
    make_colours(work);
  }

  void make_surface(FrameSetJob& work) {
    make_hull(work);
    if (!deformer_) return;
    const Stopwatch deforming;
    const SurfaceCameras seen(deform_cameras(work), work.result.mesh, grid_.voxel_m);
    if (carver_) {
      const Mesh& hull = work.result.mesh;
      carve(work, seen, carver_->find_samples(seen, hull, work.volume), {});
    }
    deformer_->run(seen, work.result.mesh);
    work.result.times.deform = deforming.ms();
  }

  void make_hull(FrameSetJob& work) {
    work.result.pulse = work.set.pulse;
    work.frames = usable_frames(work.set);
    shape(work);
  }

  PulseViews make_views(FrameSetJob& work) {
    const Stopwatch observing;
    PulseViews views(models_, work.frames, work.result.mesh, grid_.voxel_m);
    if (carver_)
      views.stereo_samples =
          carver_->find_samples(views.cameras_with_pixels(), work.result.mesh, work.volume);
    work.result.times.deform = observing.ms();
    return views;
  }

  void make_surface(FrameSetJob& work, PulseViews& now,
                    std::span<const PulseViews* const> adjacent) {
    const Stopwatch deforming;
    if (carver_) {
      std::vector<NeighbourSamples> samples;
      for (const PulseViews* then : adjacent) samples.push_back(neighbour_samples(now, *then));
      carve(work, now.cameras_with_pixels(), now.stereo_samples, samples);
    }
    deformer_->run(now.cameras_with_pixels(), work.result.mesh);
    now.set_surface(work.result.mesh);
    work.result.times.deform += deforming.ms();
  }

  void smooth_over_time(FrameSetJob& work, const PulseViews& now,
                        std::span<const PulseViews* const> adjacent) const {
    const Stopwatch smoothing;
    v3d::smooth_over_time(now, adjacent, {.voxel_m = grid_.voxel_m, .lattice = lattice_},
                          work.result.mesh);
    work.result.times.smoothing = smoothing.ms();
  }

  void make_colours(FrameSetJob& work) const {
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
                                 .occluder_radius_m = kTriangleRadiusVoxels * grid_.voxel_m,
                                 .demosaic = deformer_.has_value(),
                                 .by_resolution = deformer_.has_value()};
    result.mesh.colours = colour_vertices(result.mesh, cameras, options).colours;
    result.times.texture = texturing.ms();
  }

  void encode(FrameSetJob& work) {
    Reconstruction& result = work.result;
    const Stopwatch measuring;
    result.quality = quality_.measure(result.mesh, work.frames);
    result.times.quality = measuring.ms();
    const Stopwatch encoding;
    result.compact = compact_frame_of(work);
    // The mesh has the colours that receivers decode.
    result.mesh.colours = rgb_colours(encoder_.decoded_colours());
    result.times.encode = encoding.ms();
  }

  void begin_sequence() { encoder_.restart(); }

 private:
  std::vector<uint8_t> compact_frame_of(const FrameSetJob& work) {
    const Reconstruction& result = work.result;
    const Eigen::Vector3d& origin = grid_.origin;
    const BrickVolume volume = work.volume.view();
    const std::vector<VertexColour> colours = vertex_colours(result.mesh.colours);
    std::vector<VertexPosition> moved;
    if (deformer_) moved = vertex_positions(result.mesh.vertices);
    FrameContent content;
    content.facts = {.pulse = result.pulse,
                     .exposure_ns = to_ns(work.set.exposure),
                     .cameras = result.cameras,
                     .missing = static_cast<int>(rig_.size() - result.cameras.size()),
                     .quality = static_cast<float>(result.quality.silhouette_iou),
                     .origin = {origin.x(), origin.y(), origin.z()},
                     .step = grid_.voxel_m / 2};
    content.volume = &volume;
    content.positions = moved;
    content.triangles = result.mesh.triangles;
    content.colours = colours;
    auto compact = encoder_.encode(content);
    if (!compact) reject(result);
    return *std::move(compact);
  }

  [[noreturn]] static void reject(const Reconstruction& result) {
    throw InputError("pulse " + std::to_string(result.pulse) + ": a surface of " +
                     std::to_string(result.mesh.vertices.size()) +
                     " vertices does not fit a compact frame (docs/compact-frame.md has its "
                     "limits): use a larger voxel");
  }

  void shape(FrameSetJob& work) {
    Reconstruction& result = work.result;
    const Stopwatch intersecting;
    std::vector<const Mask*> masks;
    std::vector<uint8_t> takes_part;
    for (const Frame* frame : work.frames) {
      masks.push_back(frame != nullptr ? &*frame->mask : nullptr);
      takes_part.push_back(frame != nullptr ? 1 : 0);
    }
    intersector_.intersect(masks, work.volume);
    result.ghosts = ghosts_.remove(work.volume, takes_part);
    result.volume_m3 = volume_m3(work.volume);
    result.times.intersect = intersecting.ms();

    const Stopwatch meshing;
    marching_cubes_.run(work.volume, result.mesh);
    result.times.mesh = meshing.ms();
  }

  std::vector<DeformCamera> deform_cameras(const FrameSetJob& work) const {
    std::vector<DeformCamera> cameras;
    for (size_t c = 0; c < work.frames.size(); ++c) {
      if (work.frames[c] != nullptr) cameras.push_back({&rig_[c].model, work.frames[c]});
    }
    return cameras;
  }

  void carve(FrameSetJob& work, const SurfaceCameras& cameras, const StereoSamples& samples,
             std::span<const NeighbourSamples> adjacent) {
    work.volume = carver_->carve(cameras, work.volume, samples, adjacent);
    work.result.volume_m3 = volume_m3(work.volume);
    marching_cubes_.run(work.volume, work.result.mesh);
  }

  /// The frame of each camera of the rig; null where no frame is usable.
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
  const VertexLattice lattice_;       ///< of the resulting vertices
  std::optional<Deformer> deformer_;  ///< for Quality::kHigh
  std::optional<ConcavityCarver> carver_;
  tbb::task_arena arena_;  ///< for reconstruct()
  const QualityMeter quality_;
  // Working memory of make_mesh().
  Intersector intersector_;
  GhostRemoval ghosts_;
  MarchingCubes marching_cubes_;
  FrameEncoder encoder_;  ///< for encode()
};

Reconstructor::Reconstructor(const Rig& rig, const ReconstructOptions& options)
    : impl_(std::make_unique<Impl>(rig, options)) {}
Reconstructor::~Reconstructor() = default;

Reconstruction Reconstructor::reconstruct(FrameSet set) {
  return impl_->reconstruct(std::move(set));
}
void Reconstructor::make_mesh(FrameSetJob& work) { impl_->make_mesh(work); }
void Reconstructor::encode(FrameSetJob& work) { impl_->encode(work); }
void Reconstructor::begin_sequence() { impl_->begin_sequence(); }
void Reconstructor::make_surface(FrameSetJob& work) { impl_->make_surface(work); }
void Reconstructor::make_hull(FrameSetJob& work) { impl_->make_hull(work); }
PulseViews Reconstructor::make_views(FrameSetJob& work) { return impl_->make_views(work); }
void Reconstructor::make_surface(FrameSetJob& work, PulseViews& now,
                                 std::span<const PulseViews* const> adjacent) {
  impl_->make_surface(work, now, adjacent);
}
void Reconstructor::smooth_over_time(FrameSetJob& work, const PulseViews& now,
                                     std::span<const PulseViews* const> adjacent) const {
  impl_->smooth_over_time(work, now, adjacent);
}
void Reconstructor::make_colours(FrameSetJob& work) const { impl_->make_colours(work); }

}  // namespace v3d
