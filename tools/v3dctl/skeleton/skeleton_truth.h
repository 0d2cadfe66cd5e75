// A skeleton against the true joints of a simulated take.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::ctl {

struct JointError {
  double p50_mm = 0, p90_mm = 0;
};

struct SkeletonError {
  int64_t pulses = 0;  ///< with a skeleton and true joints
  JointError all;      ///< of the main joints at these pulses
  std::map<std::string, JointError> of_joint;
  /// Pulses at which the joints would be nearer to the true ones with left and right exchanged.
  int64_t swaps = 0;
};

/// Compares with `truth`/joints.json, which v3d-sim take --truth writes (docs/simulator.md).
/// `performer`: from 1. Throws InputError for a file that cannot be read or has no main joint of
/// this performer, and where no pulse has both.
SkeletonError compare_with_truth(const TakeSkeleton& skeleton, const std::filesystem::path& truth,
                                 int performer);

/// Largest difference of a bone's length between two pulses, as a part of its length.
double bone_length_spread(const TakeSkeleton& skeleton);

}  // namespace v3d::ctl
