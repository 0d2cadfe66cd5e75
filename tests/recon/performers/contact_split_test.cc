#include "recon/performers/contact_split.h"

#include <gtest/gtest.h>

#include <vector>

#include "recon/performers/blocks.h"

namespace v3d::recon {
namespace {

/// Labels 1 and 2 of a volume in one component, after a volume with two performers.
std::vector<PerformerVoxels> split(const SparseVolume& before,
                                   const std::vector<PerformerVoxels>& labels,
                                   const SparseVolume& now) {
  VolumeComponents components;
  components.find(now);
  EXPECT_EQ(components.count(), 1U);
  std::vector<PerformerVoxels> result;
  PreviousPulse previous{before, {}};
  for (const PerformerVoxels& performer : labels) {
    VoxelSet& set = result.emplace_back(PerformerVoxels{performer.identity, {}}).voxels;
    for (size_t b = 0; b < now.bricks().size(); ++b) {
      const int index = before.index_of(now.coords()[b]);
      set.push_back(index < 0 ? codec::kEmptyBrick
                              : common(performer.voxels[index], now.bricks()[b]));
    }
    previous.sets.push_back(&performer.voxels);
  }
  std::vector<VoxelSet*> sets;
  for (PerformerVoxels& performer : result) sets.push_back(&performer.voxels);
  ContactSplit().run(now, components.parts(0), previous, sets);
  return result;
}

/// One performer per component, in the order of the components.
std::vector<PerformerVoxels> by_component(const SparseVolume& volume) {
  VolumeComponents components;
  components.find(volume);
  std::vector<PerformerVoxels> labels;
  for (size_t c = 0; c < components.count(); ++c) {
    VoxelSet voxels(volume.bricks().size(), codec::kEmptyBrick);
    for (const ComponentPart& part : components.parts(c)) voxels[part.brick] = part.bits;
    labels.push_back({static_cast<uint8_t>(c + 1), voxels});
  }
  return labels;
}

TEST(ContactSplit, gives_every_voxel_to_one_performer) {
  const SparseVolume before = volume_of({body_at(-0.5), body_at(0.5)});
  const SparseVolume now = volume_of({body_at(-0.48), rod(-0.4, 0.4), body_at(0.48)});
  const auto labels = split(before, by_component(before), now);
  for (size_t b = 0; b < now.bricks().size(); ++b) {
    codec::Brick all = labels[0].voxels[b];
    add(all, labels[1].voxels[b]);
    EXPECT_EQ(all, now.bricks()[b]);
    EXPECT_EQ(common(labels[0].voxels[b], labels[1].voxels[b]), codec::kEmptyBrick);
  }
}

TEST(ContactSplit, gives_a_blade_that_moved_far_to_the_hand_that_holds_it) {
  // The blade is new at its place and ends beside the other body, who is touched by an arm.
  const SparseVolume before = volume_of({body_at(-0.7), body_at(0.6)});
  const SparseVolume now =
      volume_of({body_at(-0.7), rod(-0.6, 0.36, 0.1, 1.5), rod(-0.6, 0.5, -0.1, 1), body_at(0.6)});
  const auto labels = split(before, by_component(before), now);
  EXPECT_EQ(identity_at(now, labels, {0.3, 0.1, 1.5}), 1);
  EXPECT_EQ(identity_at(now, labels, {-0.4, -0.1, 1}), 1);
  EXPECT_EQ(identity_at(now, labels, {0.4, -0.1, 1}), 2);
}

TEST(ContactSplit, crosses_a_gap_of_one_voxel_within_a_body) {
  // A new piece hangs on the second performer by a long rod, and is a voxel away from the first,
  // in another brick.
  const SparseVolume before = volume_of({body_at(-0.53), body_at(0.8)});
  const SparseVolume now =
      volume_of({body_at(-0.53), rod(-0.36, 0.7), rod(-0.5, 0.7, 0.1, 0.3), body_at(0.8)});
  const auto labels = split(before, by_component(before), now);
  EXPECT_EQ(identity_at(now, labels, {-0.3, 0, 1.2}), 1);
}

TEST(ContactSplit, moves_the_border_with_bodies_that_push_each_other) {
  const auto pushed = [](double x) {
    return volume_of({body_at(x - 0.7), rod(x - 0.6, x - 0.1), body_at(x + 0.05)});
  };
  // The arm of the first ends at the body of the second.
  std::vector<PerformerVoxels> labels;
  SparseVolume before = volume_of({body_at(-0.7), rod(-0.6, -0.14), body_at(0.05)});
  labels = by_component(before);
  for (int pulse = 0; pulse <= 5; ++pulse) {
    const double x = 0.08 * pulse;
    const SparseVolume now = pushed(x);
    labels = split(before, labels, now);
    EXPECT_EQ(identity_at(now, labels, {x - 0.16, 0, 1.2}), 1) << pulse;
    EXPECT_EQ(identity_at(now, labels, {x - 0.04, 0, 1.2}), 2) << pulse;
    before = now;
  }
}

}  // namespace
}  // namespace v3d::recon
