// The performer as closed parts with procedural textures.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/geometry/mesh.h"

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

/// A closed, outward-oriented surface (world frame, metres). `paint`: by vertex the texture
/// coordinates in the rest frame of the part (metres), so that the texture moves with the part.
/// mesh.colours is empty.
struct Part {
  Mesh mesh;
  std::vector<Eigen::Vector3f> paint;
  Material material = Material::kSkin;
};

/// Body, clothes and sword; parts overlap. `seed` determines folds and patterns, but not the
/// motion.
std::vector<Part> performer_parts(double seconds, uint64_t seed);

/// The blade only, which moves fast enough for motion blur.
Part sword_blade(double seconds);

/// The procedural texture: linear diffuse R, G, B (0 to 1) at texture coordinates `place`. It has
/// more detail than the cameras resolve.
Eigen::Vector3f paint(Material material, const Eigen::Vector3f& place, uint64_t seed);

}  // namespace v3d::sim
