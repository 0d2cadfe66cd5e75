#include "recon/pipeline/stages.h"

#include <tbb/parallel_for.h>

#include <utility>

#include "base/core/error.h"
#include "base/core/time.h"
#include "base/io/process.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/surface/temporal_smoothing.h"
#include "recon/texture/texture.h"

namespace v3d::recon {
namespace {

/// The surface is accurate to about one voxel in both directions, and occluding points represent
/// their surroundings.
constexpr double kDepthToleranceVoxels = 3;

/// Half of the longest edge of a marching cubes triangle, which connects the middles of two voxel
/// edges.
constexpr double kTriangleRadiusVoxels = 0.71;

/// Deformed surfaces are quantised to a fiftieth of a voxel, which is less than their flicker.
/// docs/deformation.md compares other steps.
constexpr int kStepsInHalfVoxel = 25;
/// Live surfaces are less accurate, and coarser steps make encoding faster.
constexpr int kLiveStepsInHalfVoxel = 10;

VoxelGrid checked_grid(const Box& bounds, double voxel_m) {
  const VoxelGrid grid = VoxelGrid::covering(bounds, voxel_m);
  require_memory(grid, static_cast<double>(available_memory()));
  require_precision(grid);
  return grid;
}

/// Discrete marching cubes have half-voxel steps.
VertexLattice half_voxel_lattice(const VoxelGrid& grid) { return {grid.origin, grid.voxel_m / 2}; }

VertexLattice finer_lattice(const VoxelGrid& grid, int steps_in_half_voxel) {
  return {grid.origin, half_voxel_lattice(grid).step / steps_in_half_voxel};
}

DeformOptions checked(DeformOptions options, const VoxelGrid& grid) {
  options.voxel_m = grid.voxel_m;
  options.lattice = finer_lattice(grid, kStepsInHalfVoxel);
  check(options);
  return options;
}

SurfaceCameras surface_cameras(const std::vector<CameraModel>& models, const RigFrames& frames,
                               const Mesh& surface, double voxel_m) {
  std::vector<DeformCamera> cameras;
  for (size_t c = 0; c < frames.size(); ++c) {
    if (frames[c] != nullptr) cameras.push_back({&models[c], frames[c]});
  }
  return {cameras, surface, voxel_m};
}

bool carves(const DeformOptions& options) {
  return options.carve_concavities && options.mode == DeformMode::kSearch &&
         options.photometric > 0;
}

codec::EncoderOptions encoder_options(const VertexLattice& lattice) {
  codec::EncoderOptions options;
  options.displacement_step_m = lattice.step;
  return options;
}

}  // namespace

// --- hull

HullStage::HullStage(const Rig& rig, const Box& bounds, double voxel_m, int min_views)
    : grid_(checked_grid(bounds, voxel_m)),
      intersector_(grid_, models_of(rig), min_views),
      ghosts_(grid_, models_of(rig)) {
  for (const RigCamera& camera : rig) {
    slender_.emplace_back(camera.model.size(),
                          SlenderSizes::for_camera(camera.model, bounds, voxel_m));
  }
}

Hull HullStage::intersect(const RigFrames& frames) {
  std::vector<const Mask*> masks(frames.size(), nullptr);
  std::vector<uint8_t> takes_part(frames.size(), 0);
  tbb::parallel_for(size_t{0}, frames.size(), [&](size_t c) {
    if (frames[c] == nullptr) return;
    masks[c] = &slender_[c].widen(*frames[c]->mask);
    takes_part[c] = 1;
  });
  Hull hull;
  intersector_.intersect(masks, hull.volume);
  hull.ghosts = ghosts_.remove(hull.volume, takes_part);
  return hull;
}

Mesh HullStage::surface(const SparseVolume& volume) {
  Mesh surface;
  marching_cubes_.run(volume, surface);
  return surface;
}

// --- deformation

DeformStage::DeformStage(const Rig& rig, const VoxelGrid& grid, DeformOptions options)
    : models_(models_of(rig)),
      voxel_m_(grid.voxel_m),
      options_(checked(std::move(options), grid)),
      deformer_(options_) {
  if (carves(options_)) carver_.emplace();
}

void DeformStage::deform(const RigFrames& frames, SparseVolume& volume, Mesh& surface) {
  const SurfaceCameras seen = surface_cameras(models_, frames, surface, voxel_m_);
  if (carver_) carve(seen, carver_->find_samples(seen, surface, volume), {}, volume, surface);
  deformer_.run(seen, surface);
}

PulseViews DeformStage::views(const RigFrames& frames, const SparseVolume& volume,
                              const Mesh& surface) {
  PulseViews views(models_, frames, surface, voxel_m_);
  if (carver_) {
    views.stereo_samples = carver_->find_samples(views.cameras_with_pixels(), surface, volume);
  }
  return views;
}

void DeformStage::deform(PulseViews& now, std::span<const PulseViews* const> adjacent,
                         SparseVolume& volume, Mesh& surface) {
  if (carver_) {
    std::vector<NeighbourSamples> samples;
    for (const PulseViews* then : adjacent) samples.push_back(neighbour_samples(now, *then));
    carve(now.cameras_with_pixels(), now.stereo_samples, samples, volume, surface);
  }
  deformer_.run(now.cameras_with_pixels(), surface);
  now.set_surface(surface);
}

void DeformStage::smooth(const PulseViews& now, std::span<const PulseViews* const> adjacent,
                         Mesh& surface) const {
  smooth_over_time(now, adjacent, {.voxel_m = voxel_m_, .lattice = lattice()}, surface);
}

void DeformStage::carve(const SurfaceCameras& cameras, const StereoSamples& samples,
                        std::span<const NeighbourSamples> adjacent, SparseVolume& volume,
                        Mesh& surface) {
  volume = carver_->carve(cameras, volume, samples, adjacent);
  marching_cubes_.run(volume, surface);
}

LiveDeformStage::LiveDeformStage(const Rig& rig, const VoxelGrid& grid)
    : models_(models_of(rig)),
      voxel_m_(grid.voxel_m),
      lattice_(finer_lattice(grid, kLiveStepsInHalfVoxel)),
      deformer_({.voxel_m = voxel_m_, .lattice = lattice_}) {}

int LiveDeformStage::deform(const RigFrames& frames, int passes, Mesh& surface,
                            const PassCheck& may_run) {
  if (passes == 0 || (may_run && !may_run())) return 0;
  return deformer_.run(surface_cameras(models_, frames, surface, voxel_m_), passes, surface,
                       may_run);
}

// --- colours

void colour_surface(const Rig& rig, const RigFrames& frames, double voxel_m, ColourDetail detail,
                    Mesh& surface) {
  std::vector<TextureCamera> cameras;
  for (size_t c = 0; c < frames.size(); ++c) {
    if (frames[c] != nullptr) cameras.push_back({&rig[c].model, frames[c], &rig[c].colour});
  }
  const bool full = detail == ColourDetail::kFull;
  const TextureOptions options{.depth_tolerance_m = kDepthToleranceVoxels * voxel_m,
                               .occluder_radius_m = kTriangleRadiusVoxels * voxel_m,
                               .demosaic = full,
                               .by_resolution = full};
  surface.colours = colour_vertices(surface, cameras, options).colours;
}

// --- compact frame

namespace {

/// Throws InputError for what no other surface would make right.
void check_metadata(const codec::FrameContent& content, size_t vertices) {
  const std::string pulse = "pulse " + std::to_string(content.metadata.pulse) + ": ";
  if (const char* error = codec::metadata_error(content.metadata)) throw InputError(pulse + error);
  if (content.labels.empty() || content.labels.size() == vertices) return;
  throw InputError(pulse + "performers: expected one for each of " + std::to_string(vertices) +
                   " vertices, found " + std::to_string(content.labels.size()));
}

}  // namespace

EncodeStage::EncodeStage(const VoxelGrid& grid, const std::optional<VertexLattice>& lattice)
    : origin_(grid.origin),
      voxel_m_(grid.voxel_m),
      deformed_(lattice.has_value()),
      encoder_(encoder_options(lattice.value_or(half_voxel_lattice(grid)))) {}

std::vector<uint8_t> EncodeStage::encode(const PulseMetadata& metadata, const SparseVolume& volume,
                                         Mesh& surface) {
  const codec::BrickVolume bricks = volume.view();
  const std::vector<codec::VertexColour> colours = vertex_colours(surface.colours);
  std::vector<codec::VertexPosition> moved;
  if (deformed_) moved = vertex_positions(surface.vertices);
  codec::FrameContent content;
  content.metadata = {.pulse = metadata.pulse,
                      .exposure_ns = to_ns(metadata.exposure),
                      .cameras = metadata.cameras,
                      .late_cameras = metadata.late_cameras,
                      .missing = metadata.missing,
                      .quality = static_cast<float>(metadata.quality),
                      .origin = {origin_.x(), origin_.y(), origin_.z()},
                      .step = voxel_m_ / 2,
                      .live_passes = metadata.live_passes};
  content.volume = &bricks;
  content.positions = moved;
  content.triangles = surface.triangles;
  content.colours = colours;
  content.labels = metadata.performers;
  check_metadata(content, surface.vertices.size());
  auto compact = encoder_.encode(content);
  if (!compact) {
    throw OversizedSurface("pulse " + std::to_string(metadata.pulse) + ": a surface of " +
                           std::to_string(surface.vertices.size()) + " vertices around " +
                           std::to_string(volume.bricks().size()) +
                           " bricks of voxels does not fit a compact frame "
                           "(docs/compact-frame.md has its limits): use a larger voxel");
  }
  surface.colours = rgb_colours(encoder_.decoded_colours());
  return *std::move(compact);
}

}  // namespace v3d::recon
