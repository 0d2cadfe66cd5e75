#include "recon/performers/contact_split.h"

#include <algorithm>

#include "base/core/error.h"
#include "recon/hull/brick_halo.h"

namespace v3d::recon {
namespace {

constexpr int kSmoothingPasses = 2;

auto layers_of(const VoxelSet& set) {
  return [&set](size_t brick, int z) { return set[brick][z]; };
}

}  // namespace

void ContactSplit::run(const SparseVolume& volume, std::span<const ComponentPart> component,
                       const PreviousPulse& previous, Sets sets) {
  V3D_CHECK(!sets.empty() && sets.size() <= kMaxSets && sets.size() == previous.sets.size());
  find_near(volume, component, sets);
  if (follow_motion_) follow_motion(volume, previous, sets);
  drop_contested_seeds(volume, component, sets);
  prepare_growth(volume, component, sets);
  grow(volume, sets);
  for (const ComponentPart& part : component) {
    for (VoxelSet* set : sets) (*set)[part.brick] = common((*set)[part.brick], part.bits);
  }
  for (int pass = 0; pass < kSmoothingPasses; ++pass) smooth(volume, component, sets);
}

void ContactSplit::find_near(const SparseVolume& volume, std::span<const ComponentPart> component,
                             Sets sets) {
  std::vector<uint64_t> has_seeds(volume.bricks().size(), 0);
  for (const ComponentPart& part : component) {
    for (size_t k = 0; k < sets.size(); ++k) {
      if (!is_empty((*sets[k])[part.brick])) has_seeds[part.brick] |= uint64_t{1} << k;
    }
  }
  near_.assign(volume.bricks().size(), 0);
  for (const ComponentPart& part : component) {
    for (const int n : bricks_around(volume, part.brick)) {
      if (n >= 0) near_[part.brick] |= has_seeds[n];
    }
  }
}

/// Replaces the seeds of the border by moved labels of the previous pulse.
void ContactSplit::follow_motion(const SparseVolume& volume, const PreviousPulse& previous,
                                 Sets sets) {
  is_marked_.assign(near_.size(), 0);
  for (uint32_t first = 0; first < near_.size(); ++first) {
    if (!is_border(first) || is_marked_[first]) continue;
    collect_group(volume, first);
    const VoxelStep step = block_motion(volume, previous.volume, group_);
    for (const uint32_t b : group_) {
      const VoxelStep from = moved_back(volume.coords()[b], step);
      for (size_t k = 0; k < sets.size(); ++k) {
        (*sets[k])[b] =
            common(window_at(previous.volume, *previous.sets[k], from), volume.bricks()[b]);
      }
    }
  }
}

/// The bricks of the border that are connected to `first`.
void ContactSplit::collect_group(const SparseVolume& volume, uint32_t first) {
  group_.assign(1, first);
  is_marked_[first] = 1;
  for (size_t next = 0; next < group_.size(); ++next) {
    for (const int n : bricks_around(volume, group_[next])) {
      if (n < 0 || !is_border(n) || is_marked_[n]) continue;
      is_marked_[n] = 1;
      group_.push_back(static_cast<uint32_t>(n));
    }
  }
}

void ContactSplit::drop_contested_seeds(const SparseVolume& volume,
                                        std::span<const ComponentPart> component, Sets sets) {
  changes_.clear();
  for (const ComponentPart& part : component) {
    if (!is_border(part.brick)) continue;
    const BricksAround around = bricks_around(volume, part.brick);
    for (uint32_t k = 0; k < sets.size(); ++k) {
      if ((near_[part.brick] >> k & 1) == 0) continue;
      changes_.push_back({part.brick, k, dilated(around, layers_of(*sets[k]))});
    }
  }
  for (const Change& change : changes_) {
    for (uint32_t k = 0; k < sets.size(); ++k) {
      if (k != change.set) subtract((*sets[k])[change.brick], change.voxels);
    }
  }
}

void ContactSplit::prepare_growth(const SparseVolume& volume,
                                  std::span<const ComponentPart> component, Sets sets) {
  growable_.assign(near_.size(), codec::kEmptyBrick);
  active_.clear();
  const auto occupied_of = [&](size_t brick, int z) { return volume.bricks()[brick][z]; };
  for (const ComponentPart& part : component) {
    if (settle(part.bits, part.brick, sets)) continue;
    codec::Brick left = part.bits;
    for (const VoxelSet* set : sets) subtract(left, (*set)[part.brick]);
    if (is_empty(left)) continue;
    codec::Brick& growable = growable_[part.brick];
    growable = dilated(bricks_around(volume, part.brick), occupied_of);
    for (const VoxelSet* set : sets) subtract(growable, (*set)[part.brick]);
    active_.push_back(part.brick);
  }
}

/// Gives all voxels of a brick to the only set near it. Returns false where that is not certain.
bool ContactSplit::settle(const codec::Brick& bits, uint32_t brick, Sets sets) const {
  if (near_[brick] == 0 || is_border(brick)) return false;
  size_t only = 0;
  while ((near_[brick] >> only & 1) == 0) ++only;
  codec::Brick& own = (*sets[only])[brick];
  if (2 * voxel_count(common(own, bits)) < voxel_count(bits)) return false;
  add(own, bits);
  return true;
}

/// All sets grow at the same time, one voxel a step, until nothing changes.
void ContactSplit::grow(const SparseVolume& volume, Sets sets) {
  is_marked_.assign(near_.size(), 0);
  for (size_t step = 0; !active_.empty(); ++step) {
    changes_.clear();
    for (const uint32_t brick : active_) grow_brick(volume, sets, step, brick);
    for (const Change& change : changes_) {
      add((*sets[change.set])[change.brick], change.voxels);
      subtract(growable_[change.brick], change.voxels);
    }
    next_.clear();
    for (const Change& change : changes_) {
      for (const int n : bricks_around(volume, change.brick)) {
        if (n < 0 || is_marked_[n] || is_empty(growable_[n])) continue;
        is_marked_[n] = 1;
        next_.push_back(static_cast<uint32_t>(n));
      }
    }
    for (const uint32_t brick : next_) is_marked_[brick] = 0;
    active_.swap(next_);
  }
}

/// One step of all sets in one brick. Of sets that reach a voxel in the same step, the first and
/// the last are preferred in turn.
void ContactSplit::grow_brick(const SparseVolume& volume, Sets sets, size_t step, uint32_t brick) {
  const BricksAround around = bricks_around(volume, brick);
  codec::Brick left = growable_[brick];
  for (size_t n = 0; n < sets.size(); ++n) {
    const size_t k = step % 2 == 0 ? n : sets.size() - 1 - n;
    const codec::Brick gained = common(dilated(around, layers_of(*sets[k])), left);
    if (is_empty(gained)) continue;
    subtract(left, gained);
    changes_.push_back({brick, static_cast<uint32_t>(k), gained});
  }
}

void ContactSplit::smooth(const SparseVolume& volume, std::span<const ComponentPart> component,
                          Sets sets) {
  changes_.clear();
  for (const ComponentPart& part : component) {
    if (is_border(part.brick)) smooth_brick(volume, part, sets);
  }
  for (const Change& change : changes_) {
    for (uint32_t k = 0; k < sets.size(); ++k) {
      if (k != change.set) subtract((*sets[k])[change.brick], change.voxels);
    }
    add((*sets[change.set])[change.brick], change.voxels);
  }
}

/// One pass of the majority filter.
void ContactSplit::smooth_brick(const SparseVolume& volume, const ComponentPart& part, Sets sets) {
  const BricksAround around = bricks_around(volume, part.brick);
  std::vector<uint32_t> near;
  for (uint32_t k = 0; k < sets.size(); ++k) {
    const auto has_voxels = [&](int n) { return n >= 0 && !is_empty((*sets[k])[n]); };
    if (std::ranges::any_of(around, has_voxels)) near.push_back(k);
  }
  if (near.size() < 2) return;
  std::vector<BrickCounts> counts;
  for (const uint32_t k : near) {
    counts.push_back(neighbourhood_counts(around, layers_of(*sets[k])));
  }
  codec::Brick moved{};
  for (size_t to = 0; to < near.size(); ++to) {
    Change change{part.brick, near[to], {}};
    for (size_t from = 0; from < near.size(); ++from) {
      codec::Brick lost = common(larger(counts[to], counts[from]), (*sets[near[from]])[part.brick]);
      subtract(lost, moved);
      add(change.voxels, common(lost, part.bits));
    }
    add(moved, change.voxels);
    if (!is_empty(change.voxels)) changes_.push_back(change);
  }
}

}  // namespace v3d::recon
