#include "recon/pipeline/reconstructor.h"

#include <string>
#include <utility>

#include "base/core/error.h"

namespace v3d::recon {
namespace {

double volume_m3(const SparseVolume& volume) {
  return static_cast<double>(volume.count()) * volume.grid().voxel_volume_m3();
}

std::optional<DeformStage> deform_stage_of(const Rig& rig, const VoxelGrid& grid,
                                           const ReconstructOptions& options) {
  if (options.quality != Quality::kHigh) return std::nullopt;
  return std::optional<DeformStage>(std::in_place, rig, grid, options.deform);
}

std::optional<LiveDeformStage> live_deform_stage_of(const Rig& rig, const VoxelGrid& grid,
                                                    const ReconstructOptions& options) {
  if (options.quality != Quality::kMedium) return std::nullopt;
  if (options.live_passes < 0 || options.live_passes > kLivePasses) {
    throw InputError("live passes: expected 0 to " + std::to_string(kLivePasses) + ", found " +
                     std::to_string(options.live_passes));
  }
  return std::optional<LiveDeformStage>(std::in_place, rig, grid);
}

std::optional<VertexLattice> lattice_of(const std::optional<DeformStage>& high,
                                        const std::optional<LiveDeformStage>& medium) {
  if (high) return high->lattice();
  if (medium) return medium->lattice();
  return std::nullopt;
}

int arena_size(int threads) { return threads > 0 ? threads : tbb::task_arena::automatic; }

}  // namespace

Reconstructor::Reconstructor(const Rig& rig, const ReconstructOptions& options)
    : rig_(rig),
      arena_(arena_size(options.threads)),
      hull_(rig, options.bounds, options.voxel_m, options.min_views),
      live_passes_(options.live_passes),
      deform_(deform_stage_of(rig, hull_.grid(), options)),
      live_deform_(live_deform_stage_of(rig, hull_.grid(), options)),
      quality_(arena_.execute([&] { return QualityMeter(rig, options.bounds, options.voxel_m); })),
      encode_(hull_.grid(), lattice_of(deform_, live_deform_)) {}

Reconstruction Reconstructor::reconstruct(FrameSet set) {
  FrameSetJob work(std::move(set));
  begin_sequence();
  arena_.execute([&] {
    make_mesh(work);
    encode(work);
  });
  return std::move(work.result);
}

void Reconstructor::make_mesh(FrameSetJob& work) {
  make_surface(work);
  make_colours(work);
}

void Reconstructor::make_hull(FrameSetJob& work) {
  Reconstruction& result = work.result;
  result.pulse = work.set.pulse;
  work.frames = usable_frames(rig_, work.set);
  result.cameras = names_of(rig_, work.frames);
  result.late_cameras = late_cameras_of(work.frames, result.pulse);
  const MonotonicInstant intersecting = Monotonic::now();
  Hull hull = hull_.intersect(work.frames);
  work.volume = std::move(hull.volume);
  result.ghosts = hull.ghosts;
  result.times.intersect = milliseconds_since(intersecting);

  const MonotonicInstant meshing = Monotonic::now();
  result.mesh = hull_.surface(work.volume);
  result.times.mesh = milliseconds_since(meshing);
}

void Reconstructor::make_surface(FrameSetJob& work) {
  make_hull(work);
  if (!deform_ && !live_deform_) return;
  const MonotonicInstant deforming = Monotonic::now();
  if (deform_) {
    deform_->deform(work.frames, work.volume, work.result.mesh);
  } else {
    work.result.live_passes = live_deform_->deform(
        work.frames, work.live_passes.value_or(live_passes_), work.result.mesh, work.may_run_pass);
  }
  work.result.times.deform = milliseconds_since(deforming);
}

void Reconstructor::make_colours(FrameSetJob& work) const {
  const MonotonicInstant texturing = Monotonic::now();
  colour_surface(rig_, work.frames, hull_.grid().voxel_m,
                 deform_ ? ColourDetail::kFull : ColourDetail::kLive, work.result.mesh);
  work.result.times.texture = milliseconds_since(texturing);
}

void Reconstructor::encode(FrameSetJob& work) {
  Reconstruction& result = work.result;
  result.volume_m3 = volume_m3(work.volume);
  const MonotonicInstant measuring = Monotonic::now();
  result.quality = quality_.measure(result.mesh, work.frames);
  result.times.quality = milliseconds_since(measuring);
  const MonotonicInstant encoding = Monotonic::now();
  const PulseMetadata metadata{.pulse = result.pulse,
                               .exposure = work.set.exposure,
                               .cameras = result.cameras,
                               .late_cameras = result.late_cameras,
                               .missing = static_cast<int>(rig_.size() - result.cameras.size()),
                               .quality = result.quality.silhouette_iou,
                               .live_passes = result.live_passes,
                               .performers = result.performers};
  result.compact = encode_.encode(metadata, work.volume, result.mesh);
  result.times.encode = milliseconds_since(encoding);
}

}  // namespace v3d::recon
