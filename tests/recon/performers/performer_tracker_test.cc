#include "recon/performers/performer_tracker.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <functional>
#include <span>
#include <vector>

#include "recon/performers/blocks.h"

namespace v3d::recon {
namespace {

/// A tracker and the last volume.
class Tracked {
 public:
  void add(const std::vector<Block>& blocks) { add(pulse_ + 1, blocks); }
  void add(int64_t pulse, const std::vector<Block>& blocks) {
    pulse_ = pulse;
    volume_ = volume_of(blocks);
    performers_ = tracker_.add(pulse, volume_);
  }
  int at(double x, double y, double z) const {
    return identity_at(volume_, performers_, {x, y, z});
  }
  size_t count() const { return performers_.size(); }
  const std::vector<PerformerVoxels>& performers() const { return performers_; }

 private:
  PerformerTracker tracker_;
  int64_t pulse_ = -1;
  SparseVolume volume_;
  std::vector<PerformerVoxels> performers_;
};

/// The first performer walks to the second, pushes him by 0.5 m with an arm, and walks back. 41
/// pulses; in contact from pulse 10 to 22.
struct Push {
  double first = 0, second = 0;  ///< x of the bodies
  bool in_contact = false;

  explicit Push(int pulse) {
    const int pushing = std::clamp(pulse - 10, 0, 12), back = std::max(0, pulse - 22);
    first = -1.1 + 0.04 * std::min(pulse, 10) + 0.042 * pushing - 0.04 * back;
    second = 0.0 + 0.042 * pushing;
    in_contact = pulse >= 10 && pulse <= 22;
  }
  /// The position where the arm ends.
  double hand() const { return first + 0.55; }
  std::vector<Block> blocks() const {
    return {body_at(first), rod(first, hand()), body_at(second)};
  }
};

TEST(PerformerTracker, keeps_identities_through_a_push_and_after_it) {
  Tracked tracked;
  for (int pulse = 0; pulse <= 40; ++pulse) {
    const Push push(pulse);
    tracked.add(push.blocks());
    ASSERT_EQ(tracked.count(), 2U) << pulse;
    EXPECT_EQ(tracked.at(push.first, 0, 0.5), 1) << pulse;
    EXPECT_EQ(tracked.at(push.second, 0, 0.5), 2) << pulse;
    EXPECT_EQ(tracked.at(push.hand() - 0.09, 0, 1.2), 1) << pulse;
    EXPECT_EQ(tracked.at(push.second - 0.05, 0, 1.2), 2) << pulse;
  }
}

TEST(PerformerTracker, keeps_identities_when_pulses_are_dropped_or_empty) {
  Tracked all, some;
  for (int pulse = 0; pulse <= 40; ++pulse) {
    const Push push(pulse);
    all.add(pulse, push.blocks());
    if (pulse % 3 == 1) continue;
    if (pulse % 3 == 2) {
      some.add(pulse, {});
      EXPECT_EQ(some.count(), 0U);
      continue;
    }
    some.add(pulse, push.blocks());
    EXPECT_EQ(some.at(push.first, 0, 0.5), 1) << pulse;
    EXPECT_EQ(some.at(push.second, 0, 0.5), 2) << pulse;
    if (push.in_contact) continue;
    ASSERT_EQ(some.count(), 2U);
    for (size_t p = 0; p < 2; ++p) {
      EXPECT_EQ(some.performers()[p].voxels, all.performers()[p].voxels) << pulse;
    }
  }
}

TEST(PerformerTracker, gives_a_thrown_ball_to_the_thrower_until_another_catches_it) {
  Tracked tracked;
  const auto ball = [](double x) {
    return Block(Eigen::Vector3d(x - 0.06, -0.06, 1.34), Eigen::Vector3d(x + 0.06, 0.06, 1.46));
  };
  // 0.2 m per pulse; the ball leaves the hand and reaches the second body.
  for (int pulse = 0; pulse <= 9; ++pulse) {
    const double x = -0.82 + 0.2 * pulse;
    tracked.add({body_at(-1), body_at(1), ball(x)});
    EXPECT_EQ(tracked.at(x, 0, 1.4), x < 0.7 ? 1 : 2) << "at " << x;
    EXPECT_EQ(tracked.at(-1, 0, 0.5), 1);
    EXPECT_EQ(tracked.at(1, 0, 0.5), 2);
  }
}

TEST(PerformerTracker, lets_the_pieces_of_a_broken_blade_follow_their_performer) {
  Tracked tracked;
  tracked.add({body_at(-0.5), body_at(0.8)});
  // The blade is at a new height in each pulse, and breaks off at two places.
  for (const double z : {0.3, 0.7, 1.1, 1.5, 1.0, 0.5}) {
    tracked.add({body_at(-0.5), body_at(0.8), rod(-0.4, -0.2, 0, z), rod(-0.14, 0.1, 0, z),
                 rod(0.2, 0.4, 0, z)});
    EXPECT_EQ(tracked.at(0, 0, z), 1) << "at height " << z;
    EXPECT_EQ(tracked.at(0.3, 0, z), 1) << "at height " << z;
  }
}

TEST(PerformerTracker, gives_objects_of_the_first_pulse_to_the_nearest_performer) {
  Tracked tracked;
  for (int pulse = 0; pulse < 3; ++pulse) {
    tracked.add({rod(-0.2, 0.1), body_at(-0.5), body_at(0.8), rod(1.44, 1.5)});
    EXPECT_EQ(tracked.at(0, 0, 1.2), 1);
    EXPECT_EQ(tracked.at(1.45, 0, 1.2), 2);
  }
}

TEST(PerformerTracker, leaves_an_object_without_label_that_nobody_is_near) {
  Tracked tracked;
  for (int pulse = 0; pulse < 3; ++pulse) {
    tracked.add({body_at(-1.2), rod(0.2, 0.5)});
    EXPECT_EQ(tracked.at(0.3, 0, 1.2), 0);
  }
}

TEST(PerformerTracker, gives_a_third_performer_who_enters_a_new_identity) {
  Tracked tracked;
  for (int pulse = 0; pulse < 16; ++pulse) {
    const double y = -1.0 + 0.05 * pulse;  // the space begins at -0.8
    tracked.add({body_at(-1.2, 0.3), body_at(1.2, 0.3), body_at(0, y)});
    EXPECT_EQ(tracked.at(-1.2, 0.3, 0.5), 1);
    EXPECT_EQ(tracked.at(1.2, 0.3, 0.5), 2);
    if (pulse <= 4) continue;
    EXPECT_EQ(tracked.at(0, y + 0.1, 0.5), 3) << pulse;
  }
}

TEST(PerformerTracker, gives_a_performer_who_returns_a_new_identity) {
  Tracked tracked;
  tracked.add({body_at(-1), body_at(0)});
  EXPECT_EQ(tracked.at(0, 0, 0.5), 2);
  tracked.add({body_at(-1)});
  EXPECT_EQ(tracked.count(), 1U);
  tracked.add({body_at(-1), body_at(0)});
  EXPECT_EQ(tracked.at(-1, 0, 0.5), 1);
  EXPECT_EQ(tracked.at(0, 0, 0.5), 3);
}

TEST(PerformerTracker, has_one_identity_for_performers_who_begin_in_contact_until_they_part) {
  Tracked tracked;
  for (int pulse = 0; pulse < 3; ++pulse) {
    tracked.add({body_at(-0.6), rod(-0.6, 0), body_at(0.1)});
    EXPECT_EQ(tracked.count(), 1U);
  }
  for (int pulse = 0; pulse < 10; ++pulse) {
    tracked.add({body_at(-0.62), body_at(0.12)});
    EXPECT_EQ(tracked.at(-0.62, 0, 0.5), 1) << pulse;
    EXPECT_EQ(tracked.at(0.12, 0, 0.5), pulse < 5 ? 1 : 2) << pulse;
  }
}

TEST(PerformerTracker, continues_after_an_undone_volume_as_if_it_had_not_been_added) {
  PerformerTracker tracker, undoing;
  const auto expect_the_same = [&](int64_t pulse, const std::vector<Block>& blocks) {
    const SparseVolume volume = volume_of(blocks);
    const auto& expected = tracker.add(pulse, volume);
    const auto& found = undoing.add(pulse, volume);
    ASSERT_EQ(found.size(), expected.size()) << pulse;
    for (size_t p = 0; p < found.size(); ++p) {
      EXPECT_EQ(found[p].identity, expected[p].identity) << pulse;
      EXPECT_EQ(found[p].voxels, expected[p].voxels) << pulse;
    }
  };
  for (int pulse = 0; pulse <= 40; ++pulse) {
    const Push push(pulse);
    if (pulse % 3 == 0) {
      undoing.add(pulse, volume_of({body_at(push.first), body_at(1.2)}));
      undoing.undo();
      undoing.add(pulse, volume_of({}));
      undoing.undo();
    }
    expect_the_same(pulse, push.blocks());
  }
  std::vector<Block> three = Push(40).blocks();
  three.push_back(body_at(1.2));
  expect_the_same(41, three);
}

/// Frames of one grid state 2 cm with different rounding errors. The limit of 0.6 m is 30 voxels.
TEST(PerformerTracker, gives_an_object_to_a_performer_whatever_the_rounding_of_the_voxel) {
  const SparseVolume volume = volume_of({body_at(0), rod(0.7, 0.9)});  // 29 voxels apart
  std::vector<PlacedBrick> bricks;
  for (size_t b = 0; b < volume.bricks().size(); ++b) {
    bricks.push_back({volume.coords()[b], volume.bricks()[b]});
  }
  const std::span<const PlacedBrick> part(bricks);
  for (const double voxel_m : {0.02, std::nextafter(0.02, 0.0), std::nextafter(0.02, 1.0)}) {
    VoxelGrid grid = volume.grid();
    grid.voxel_m = voxel_m;
    const SparseVolume rounded(grid, {&part, 1});
    PerformerTracker tracker;
    EXPECT_EQ(identity_at(rounded, tracker.add(0, rounded), {0.81, 0.01, 1.19}), 1) << voxel_m;
  }
}

TEST(PerformerTracker, does_not_depend_on_the_number_of_threads) {
  const tbb::global_control more_threads_than_cores(tbb::global_control::max_allowed_parallelism,
                                                    4);
  const auto with_threads = [](int threads) {
    tbb::task_arena arena(threads);
    return arena.execute([] {
      Tracked tracked;
      for (int pulse = 0; pulse <= 20; ++pulse) tracked.add(Push(pulse).blocks());
      std::vector<VoxelSet> sets;
      for (const PerformerVoxels& performer : tracked.performers())
        sets.push_back(performer.voxels);
      return sets;
    });
  };
  EXPECT_EQ(with_threads(1), with_threads(4));
}

}  // namespace
}  // namespace v3d::recon
