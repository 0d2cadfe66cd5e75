// The performer as closed parts, each with the coordinates its texture is painted in.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/mesh.h"

namespace v3d::sim {

enum class Material : uint8_t {
  kSkin,
  kFace,
  kHair,
  kJacket,
  kTrousers,
  kBelt,
  kSock,
  kBlade,
  kHandle,
  kGuard
};

/// A closed, outward-oriented surface. mesh.vertices is in the world; `paint` gives, per vertex,
/// the place in the part's own rest frame (metres) where paint() is evaluated, so that a texture
/// sticks to its part however that moves. mesh.colours stays empty here.
struct Part {
  Mesh mesh;
  std::vector<Eigen::Vector3f> paint;
  Material material = Material::kSkin;
};

/// Body, clothes and sword; parts overlap. `seed` chooses folds and patterns, not the motion.
std::vector<Part> performer_parts(double seconds, uint64_t seed);

/// The blade alone: what moves fast enough to blur within an exposure.
Part sword_blade(double seconds);

/// The texture: diffuse colour, red green blue in 0..1, at a place of the part's rest frame. Finer
/// than any camera of the studio resolves.
Eigen::Vector3f paint(Material material, const Eigen::Vector3f& place, uint64_t seed);

}  // namespace v3d::sim
