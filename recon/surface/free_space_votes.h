// What cameras that agree about a place say of the voxels before and behind it.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <vector>

#include "recon/hull/sparse_volume.h"

namespace v3d {

/// Votes of two kinds for the voxels of a volume: something was seen through them, and something
/// was seen there. Votes may come from several threads at a time; sums do not depend on the order.
/// A voxel counts up to kMaxVotes votes of a kind; further ones change nothing.
class FreeSpaceVotes {
 public:
  static constexpr uint32_t kMaxVotes = 1 << 15;

  /// `volume` is borrowed and must not change.
  explicit FreeSpaceVotes(const SparseVolume& volume);

  /// The volume's brick that holds a place in the world, metres; -1 where none is stored.
  int brick_at(const Eigen::Vector3f& place) const;

  // Places in the world, metres; each gives the voxel so many votes. Those outside the volume are
  // lost.
  void vote_free(const Eigen::Vector3f& place, uint8_t votes = 1) { vote(place, kFree * votes); }
  void vote_occupied(const Eigen::Vector3f& place, uint8_t votes = 1) {
    vote(place, kOccupied * votes);
  }

  /// The occupied voxels that were seen through at least `least` times (1 or more), and more often
  /// than something was seen there; votes count for the voxel and the 26 around it. A brick for
  /// each of the volume. Works in the caller's TBB arena.
  std::vector<Brick> free_voxels(int least) const;

 private:
  // Both counts in one number, so that votes are one addition. A count that has reached kMaxVotes
  // takes no more, so it stays below kMaxVotes + 256 and never reaches the other half. A frame
  // gives a voxel some thousands.
  static constexpr uint32_t kFree = 1, kOccupied = 1 << 16;
  static_assert(kMaxVotes + UINT8_MAX < kOccupied);
  /// The voxel; empty where there can be none.
  std::optional<Eigen::Vector3i> voxel_at(const Eigen::Vector3f& place) const;
  int brick_of(const Eigen::Vector3i& voxel) const;
  void vote(const Eigen::Vector3f& place, uint32_t what);

  const SparseVolume& volume_;
  const Eigen::Vector3f origin_;
  const float per_metre_;
  std::vector<std::atomic<uint32_t>> votes_;  ///< 512 a brick
  std::vector<std::atomic<bool>> has_free_;   ///< bricks with voxels that were seen through
};

}  // namespace v3d
