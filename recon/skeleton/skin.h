// Skin: linear blend skinning of a surface by a skeleton.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "recon/skeleton/kinematic_structure.h"
#include "recon/skeleton/rigid_parts.h"

namespace v3d::recon {

/// The parts that move a vertex, named by their joints, with weights that sum to 1. Unused entries
/// have weight 0.
struct SkinInfluence {
  static constexpr size_t kParts = 4;  ///< as glTF readers expect
  std::array<Joint, kParts> part{};
  std::array<float, kParts> weight{};
};

/// Parameters of the linear blend skinning of a tracked surface.
struct Skin {
  SkeletonPulse rest;                     ///< the skeleton at the rest pulse of the surface
  std::vector<SkinInfluence> influences;  ///< [vertex]
};

/// Motions of all parts from one skeleton to another, by joint.
PartMotion part_motion(const SkeletonPulse& from, const SkeletonPulse& to);

/// Vertices at `positions`, moved by linear blend skinning. One position per influence.
std::vector<Eigen::Vector3f> skinned(const Skin& skin, const PartMotion& motion,
                                     std::span<const Eigen::Vector3f> positions);

/// Learns the weights of the vertices from their paths: each is a blend of its own part and one
/// that touches it, smoothed over the surface. `pulses`: the skeleton at each pulse of the body.
/// Works in the caller's TBB arena; deterministic.
///
/// Source: Le and Deng, Smooth skinning decomposition with rigid bones, SIGGRAPH Asia 2012.
Skin fit_skin(const TrackedBody& body, const RigidParts& parts,
              std::span<const SkeletonPulse> pulses);

}  // namespace v3d::recon
