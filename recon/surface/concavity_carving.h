// Concavity carving: removes voxels of a visual hull that photo-consistency shows to be empty, such
// as the space between arms and trunk.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"
#include "base/image/mask.h"
#include "recon/hull/sparse_volume.h"
#include "recon/visibility/surface_camera.h"

namespace v3d::recon {

/// Stereo sample: the accepted depth of one vertex, on which cameras agree.
struct StereoSample {
  static constexpr size_t kMaxCameras = 6;
  Eigen::Vector3f position;  ///< world, metres
  Eigen::Vector3f outwards;  ///< unit normal of the surface where the depth search started
  float depth_m = 0;         ///< depth below that surface
  std::array<uint16_t, kMaxCameras> cameras{};  ///< that agree: indices into the SurfaceCameras
  uint8_t count = 0;                            ///< of these, 2 or more
  uint8_t vertices = 0;  ///< number of vertices that the sample represents: its votes
};

/// The stereo samples of one pulse.
struct StereoSamples {
  std::vector<StereoSample> samples;
  std::vector<Mask> covered;  ///< by camera: covered_pixels() of the hull
};

/// The stereo samples of an adjacent pulse. A sample counts only for cameras in which nothing moved
/// between the two pulses.
struct NeighbourSamples {
  const StereoSamples* samples = nullptr;
  /// One camera at that pulse and at the current one; `now` is null where it has no frame now.
  struct Camera {
    const SurfaceCamera* then = nullptr;
    const SurfaceCamera* now = nullptr;
  };
  std::vector<Camera> cameras;  ///< indexed by StereoSample::cameras
};

/// Removes voxels from a visual hull in three passes.
///
/// 1. Stereo: for a subset of the vertices, the depth below the surface is searched at which any
/// two cameras agree, up to 25 voxels deep (correlate_pairs()). BeliefPropagation makes
/// neighbouring vertices agree.
///
/// 2. Free-space votes: the ray from an accepted sample to each agreeing camera votes for the
/// voxels that it crosses (FreeSpaceVotes). Voxels with more votes for empty than for occupied are
/// removed (VolumeCut).
///
/// 3. The surface that this exposes is searched again, twice.
///
/// Voxels that explain foreground of a camera are kept (uncovered_pixels()). Samples of adjacent
/// pulses vote too, camera by camera, where the image did not change, so that static parts are
/// carved alike at every pulse.
///
/// The paper deforms the mesh of the hull itself. When a mesh is pushed into a concavity, the
/// hull's surface in front of the concavity remains as walls. So the volume must be carved first.
///
/// Keeps its working memory. One caller at a time; works in the caller's TBB arena. Deterministic:
/// independent of thread count and instruction set.
///
/// Source: based on the probabilistic visibility of Hernandez, Vogiatzis and Cipolla (CVPR 2007).
/// It uses belief propagation on the surface instead of depth maps, and a majority vote instead of
/// a minimum cut.
class ConcavityCarver {
 public:
  ConcavityCarver();
  ~ConcavityCarver();

  /// Stereo samples of one pulse. `hull` is the surface of `volume`, in metres in the world. Empty
  /// for fewer than two cameras or an empty hull.
  StereoSamples find_samples(const SurfaceCameras& cameras, const Mesh& hull,
                             const SparseVolume& volume);
  /// The part of `volume` that remains. `samples` is the result of find_samples() for the same
  /// cameras and volume; `adjacent` are the samples of the pulses before and after, or empty.
  SparseVolume carve(const SurfaceCameras& cameras, const SparseVolume& volume,
                     const StereoSamples& samples, std::span<const NeighbourSamples> adjacent);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// Free-space votes: counts, by voxel, how many camera rays cross it and how many surface samples
// lie in it.

/// Counts two kinds of votes for each voxel of a volume: for empty (a ray crosses it) and for
/// occupied (a surface lies in it). Each count saturates at kMaxVotes.
///
/// Several threads may vote at the same time; the sums do not depend on the order.
class FreeSpaceVotes {
 public:
  static constexpr uint32_t kMaxVotes = 1 << 15;

  /// `volume` is borrowed and must not change.
  explicit FreeSpaceVotes(const SparseVolume& volume);

  /// Index of the volume's brick that contains `position` (world, metres); -1 where no brick is
  /// stored.
  int brick_at(const Eigen::Vector3f& position) const;

  /// Adds `votes` to the voxel at `position` (world, metres). Votes outside the volume are ignored.
  void vote_free(const Eigen::Vector3f& position, uint8_t votes = 1) {
    vote(position, kFree * votes);
  }
  void vote_occupied(const Eigen::Vector3f& position, uint8_t votes = 1) {
    vote(position, kOccupied * votes);
  }

  /// The occupied voxels with at least `min_votes` votes for empty (1 or more) and fewer votes for
  /// occupied than for empty. Votes are summed over the voxel and its 26 neighbours. The result has
  /// one brick for each brick of the volume. Works in the caller's TBB arena.
  std::vector<codec::Brick> free_voxels(int min_votes) const;

 private:
  // Both counts share one number, so that a vote is one addition. A count that has reached
  // kMaxVotes is not increased. So it stays below kMaxVotes + 256 and never reaches the other half.
  // A voxel gets some thousand votes per frame.
  static constexpr uint32_t kFree = 1, kOccupied = 1 << 16;
  static_assert(kMaxVotes + UINT8_MAX < kOccupied);
  /// The voxel; empty where there can be none.
  std::optional<Eigen::Vector3i> voxel_at(const Eigen::Vector3f& position) const;
  int brick_of(const Eigen::Vector3i& voxel) const;
  void vote(const Eigen::Vector3f& position, uint32_t what);

  const SparseVolume& volume_;
  const Eigen::Vector3f origin_;
  const float per_metre_;
  std::vector<std::atomic<uint32_t>> votes_;  ///< 512 a brick
  std::vector<std::atomic<bool>> has_free_;   ///< bricks that rays crossed
};

// Silhouette coverage: the foreground that a volume explains, before and after a part of it is
// removed.

/// The foreground pixels of `camera` where `depth`, its depth buffer, shows a surface.
Mask covered_pixels(const SurfaceCamera& camera, const DepthBuffer& depth);

/// The pixels of `before`, and those next to them, where `after` shows no surface. `before` is
/// covered_pixels() of the volume before carving, `after` the depth buffer of the volume after it.
/// Rims of one or two pixels are left out, because voxels restored for them would stand out as
/// fins.
Mask uncovered_pixels(const Mask& before, const DepthBuffer& after);

/// The voxels of `some` whose centre projects to one of a camera's `pixels`. `some` and the result
/// have one brick for each of the volume's. Works in the caller's TBB arena.
std::vector<codec::Brick> voxels_at(std::span<const Mask> pixels,
                                    std::span<const SurfaceCamera> cameras,
                                    const SparseVolume& volume, std::span<const codec::Brick> some);

}  // namespace v3d::recon
