// Removal of ghosts: components of a visual hull that no silhouette proves.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "recon/hull/sparse_volume.h"
#include "recon/hull/volume_components.h"

namespace v3d::recon {

struct GhostOptions {
  /// Components of at least this volume are kept, cubic metres. 10 litres: a torso has 40.
  double max_volume_m3 = 0.01;
  /// Number of cameras that must prove a component. Half of the cameras that see it are sufficient.
  int min_proofs = 3;
};

/// Removes ghosts (phantom volumes) from visual hulls.
///
/// A hull has every point that all silhouettes allow. Between and behind the objects, several
/// silhouettes can overlap by chance: this makes loose components where nothing is. In every camera
/// such a component lies on lines of sight that already meet another one. A camera *proves* a
/// component when at least half of the lines of sight to its voxels meet no other component. The
/// largest component, and those that enough cameras prove, are kept: a thrown object or a piece of
/// a sword is proven by most cameras. Noise in one mask proves a component to one camera.
///
/// Components are tested one after the other against all others that are not known as ghosts: those
/// with the fewest proofs first, because ghosts can hide an object until they are removed.
/// A line of sight meets a component when it passes one of its voxels or a neighbour of one,
/// because voxels near a rim can be missing. One caller at a time. Deterministic.
/// Source: Michoud, Guillou, Briceno and Bouakaz, "Largest silhouette-equivalent volume for 3D
/// shapes modeling without ghost object", 2008, which proves components by silhouettes in this way.
class GhostRemoval {
 public:
  GhostRemoval(const VoxelGrid& grid, std::span<const CameraModel> cameras,
               const GhostOptions& options = {});

  /// Removes the ghosts from `volume`, a hull of the cameras for which `takes_part` is nonzero.
  /// Returns their number. Leaves a volume without ghosts unchanged. Requires one entry per camera.
  int remove(SparseVolume& volume, std::span<const uint8_t> takes_part);

 private:
  struct Candidate {
    size_t component = 0;
    int missing_proofs = 0;  ///< at the last test; before it, all
  };
  std::vector<Candidate> candidates() const;
  bool is_ghost(const SparseVolume& volume, Candidate& candidate,
                std::span<const uint8_t> takes_part, int missing);
  int missing_proofs(const SparseVolume& volume, std::span<const uint8_t> takes_part);
  void sample(const SparseVolume& volume, size_t component);
  bool is_met(const SparseVolume& volume, const Eigen::Vector3d& eye, const Eigen::Vector3d& voxel);
  const codec::Brick& near_others(const SparseVolume& volume, size_t brick);

  const VoxelGrid grid_;
  const std::vector<CameraModel> cameras_;
  const GhostOptions options_;
  std::vector<Eigen::Vector3d> eyes_;  ///< of the cameras, in voxels of the grid
  VolumeComponents components_;
  /// Centres of some voxels of the tested component, in voxels of the grid.
  std::vector<Eigen::Vector3d> samples_;
  // By brick of the volume.
  std::vector<codec::Brick> ignored_;  ///< voxels of the tested component and of the ghosts
  std::vector<codec::Brick> near_;     ///< voxels in or beside the other components
  std::vector<uint8_t> has_near_;      ///< near_ is computed
};

}  // namespace v3d::recon
