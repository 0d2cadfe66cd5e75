#include "recon/surface/motion_mask.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace v3d {
namespace {

using Eigen::Vector2f;

/// Half resolution has less noise and covers a wider area.
constexpr int kLevel = 1;
constexpr int kReach = 1;  ///< pixels of the level to each side that are compared
/// Mean differences of brightness. Without motion it is about 0.5 for the noise of a good camera
/// (1.5 grey values per pixel), and 1 for a bad one.
constexpr float kStill = 1.5F;
constexpr float kMoving = 3;
/// Largest change of an outline without motion, pixels of picture(0).
constexpr float kMaxOutlineShift = 3;

int lattice_place(float at, float scale, float first) {
  return static_cast<int>(std::floor(at * scale - first + 0.5F));
}

/// Mean absolute difference around a pixel of the camera; empty beyond the border of an image.
std::optional<float> difference(const Luminance& a, const Luminance& b, const Vector2f& pixel) {
  constexpr int kRoom = Luminance::kBorder + kReach;
  const auto corner = [&](const Luminance& p) -> const uint32_t* {
    const int x = lattice_place(pixel.x(), p.scale(), p.first_u());
    const int y = lattice_place(pixel.y(), p.scale(), p.first_v());
    const bool inside = x >= kRoom && y >= kRoom && x < p.width() - kRoom && y < p.height() - kRoom;
    return inside ? p.quads() + static_cast<size_t>(y) * p.width() + x : nullptr;
  };
  const uint32_t *from = corner(a), *to = corner(b);
  if (from == nullptr || to == nullptr) return std::nullopt;
  int sum = 0;
  for (int dy = -kReach; dy <= kReach; ++dy) {
    for (int dx = -kReach; dx <= kReach; ++dx) {
      // The lowest byte of a quad is the pixel's own brightness.
      sum += std::abs(static_cast<int>(from[dy * a.width() + dx] & 255) -
                      static_cast<int>(to[dy * b.width() + dx] & 255));
    }
  }
  return static_cast<float>(sum) / ((2 * kReach + 1) * (2 * kReach + 1));
}

/// True when no foreground is near the pixel.
bool lost(const SurfaceCamera& camera, const Vector2f& pixel) {
  const float shift = kMaxOutlineShift * camera.coarseness();
  for (const Vector2f& aside : {Vector2f(0, 0), Vector2f(shift, 0), Vector2f(-shift, 0),
                                Vector2f(0, shift), Vector2f(0, -shift)}) {
    if (camera.in_silhouette(pixel + aside)) return false;
  }
  return true;
}

}  // namespace

float static_weight(const SurfaceCamera& now, const SurfaceCamera& then, const Vector2f& pixel) {
  if (lost(then, pixel)) return 0;
  const auto change = difference(now.picture(kLevel), then.picture(kLevel), pixel);
  return change ? std::clamp((kMoving - *change) / (kMoving - kStill), 0.0F, 1.0F) : 0;
}

}  // namespace v3d
