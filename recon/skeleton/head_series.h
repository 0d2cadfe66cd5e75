// The head of a body over the pulses of a take.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "recon/skeleton/body_evidence.h"

namespace v3d::recon {

/// A pulse whose mesh shows a body.
struct SeenPulse {
  size_t index = 0;    ///< of the evidence
  int64_t number = 0;  ///< of the pulse: 25 a second
  const BodyEvidence* evidence = nullptr;
};

/// World frame, metres.
struct HeadPosition {
  Eigen::Vector3d head = Eigen::Vector3d::Zero(), neck = Eigen::Vector3d::Zero();
  double weight = 0;  ///< 1: an end of the graph; less: interpolated; 0: unknown
};

/// The head at all pulses of `seen`, which have ascending numbers: the longest series of ends of
/// graphs that agree with one another, and positions between them. A raised arm can look like a
/// head.
std::vector<HeadPosition> follow_head(std::span<const SeenPulse> seen);

}  // namespace v3d::recon
