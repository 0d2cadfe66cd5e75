// Evidence for concavity carving: free-space votes, silhouette coverage.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "recon/hull/sparse_volume.h"
#include "recon/visibility/surface_camera.h"

namespace v3d::recon {

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
