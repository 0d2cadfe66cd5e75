// The skeleton of a person who turns, without meshes.
#pragma once

#include <cstddef>
#include <cstdint>

#include "recon/skeleton/body_model.h"
#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::test {

/// A person who stands at (1, 2), and turns by 0.5 rad a pulse.
inline ctl::TakeSkeleton turning(size_t pulses) {
  ctl::TakeSkeleton skeleton;
  skeleton.rate_hz = 25;
  skeleton.structure.lengths = recon::BodyLengths(1.75, 0.5);
  for (size_t n = 0; n < pulses; ++n) {
    skeleton.pulses.push_back(static_cast<int64_t>(10 + n));
    recon::SkeletonPulse pulse;
    pulse.index = n;
    pulse.joints = recon::standing_pose(skeleton.structure.lengths, {1, 2, 0.93},
                                        0.5 * static_cast<double>(n));
    pulse.rotations = recon::joint_rotations(pulse.joints);
    skeleton.structure.pulses.push_back(pulse);
  }
  return skeleton;
}

}  // namespace v3d::test
