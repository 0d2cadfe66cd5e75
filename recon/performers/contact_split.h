// Division of a connected component of a volume among performers who touch.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "recon/hull/sparse_volume.h"
#include "recon/hull/volume_components.h"
#include "recon/performers/contact_motion.h"
#include "recon/performers/voxel_set.h"

namespace v3d::recon {

/// The volume of the previous pulse and the voxels that each performer had in it.
struct PreviousPulse {
  const SparseVolume& volume;
  std::vector<const VoxelSet*> sets;
};

/// Propagates the labels of the previous pulse into a component in which performers touch:
///
/// 1. Voxels that had a label in the previous pulse keep it: the seeds. The border must move with
///    the bodies. So near it, in bricks with seeds of two performers in or beside them, seeds are
///    the labels of the previous pulse moved by block_motion(), one motion for each connected
///    group of such bricks.
/// 2. Seeds beside a seed of another performer are dropped.
/// 3. Multi-source geodesic growth (a discrete Voronoi diagram in the component). A step goes to
///    the 18 neighbours that share a face or an edge. It may pass through empty voxels beside
///    occupied ones, because hulls have narrow gaps within one body. So a part that moved far from
///    its seeds follows what it hangs on. A brick near seeds of one performer only, at least half
///    of them seeds, gets that label without growth.
/// 4. Twice, each voxel takes the most frequent label among the 27 voxels in and around it.
///
/// Keeps its working memory between calls. One thread. Deterministic.
class ContactSplit {
 public:
  static constexpr size_t kMaxSets = 64;

  /// Without `follow_motion`, step 1 uses the labels where they were.
  explicit ContactSplit(bool follow_motion = true) : follow_motion_(follow_motion) {}

  /// Divides `component` of `volume`. `sets`: in, the voxels of the component that have a label of
  /// the previous pulse, in the order of `previous.sets`; out, disjoint sets that together are the
  /// component, or all without it where step 2 left no seed. Voxels of other components stay as
  /// they are. Requires 1 to kMaxSets sets and volumes of the same grid.
  void run(const SparseVolume& volume, std::span<const ComponentPart> component,
           const PreviousPulse& previous, std::span<VoxelSet* const> sets);

 private:
  /// Voxels of `brick` that `set` gets.
  struct Change {
    uint32_t brick = 0;
    uint32_t set = 0;
    codec::Brick voxels{};
  };
  using Sets = std::span<VoxelSet* const>;

  void find_near(const SparseVolume& volume, std::span<const ComponentPart> component, Sets sets);
  bool is_border(size_t brick) const { return (near_[brick] & (near_[brick] - 1)) != 0; }
  void follow_motion(const SparseVolume& volume, const PreviousPulse& previous, Sets sets);
  void collect_group(const SparseVolume& volume, uint32_t first);
  void drop_contested_seeds(const SparseVolume& volume, std::span<const ComponentPart> component,
                            Sets sets);
  void prepare_growth(const SparseVolume& volume, std::span<const ComponentPart> component,
                      Sets sets);
  bool settle(const codec::Brick& bits, uint32_t brick, Sets sets) const;
  void grow(const SparseVolume& volume, Sets sets);
  void grow_brick(const SparseVolume& volume, Sets sets, size_t step, uint32_t brick);
  void smooth(const SparseVolume& volume, std::span<const ComponentPart> component, Sets sets);
  void smooth_brick(const SparseVolume& volume, const ComponentPart& part, Sets sets);

  const bool follow_motion_;
  // By brick of the volume.
  std::vector<uint64_t> near_;          ///< bit k: set k has seeds in or beside it; 0 outside
  std::vector<codec::Brick> growable_;  ///< voxels through which sets may still grow
  std::vector<uint8_t> is_marked_;
  std::vector<uint32_t> group_, active_, next_;
  std::vector<Change> changes_;
};

}  // namespace v3d::recon
