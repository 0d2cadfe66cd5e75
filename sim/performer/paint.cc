// Procedural textures: functions of the position in the part's rest frame (metres). They combine
// clear patterns and value noise, so that they have detail at every scale that a camera resolves.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim/performer/performer.h"
#include "sim/rendering/noise.h"

namespace v3d::sim {
namespace {

using Eigen::Vector3f;

float step(float edge0, float edge1, float x) {
  const float s = std::clamp((x - edge0) / (edge1 - edge0), 0.0F, 1.0F);
  return s * s * (3 - 2 * s);
}
Vector3f blend(const Vector3f& a, const Vector3f& b, float s) { return a + s * (b - a); }

/// Angle about z from x, radians. In double precision: that of floats has other last bits in other
/// versions of glibc, and a simulated take has the same bytes on Debian 12 and 13.
float azimuth(const Vector3f& p) {
  return static_cast<float>(std::atan2(double{p.y()}, double{p.x()}));
}

/// A factor of fine noise around 1.
float grain(const Vector3f& p, float cells_per_metre, float depth, uint32_t seed) {
  const float coarse = value_noise(p * cells_per_metre, seed);
  const float fine = value_noise(p * (3.1F * cells_per_metre), seed + 1);
  return 1 + depth * (1.3F * coarse + 0.7F * fine - 1.0F);
}

/// Colours of what differs between performers.
struct Clothes {
  Vector3f hair, jacket, diamond, trousers, stripe, belt, belt_wave;
};

const Clothes& clothes_of(Palette palette) {
  static const Clothes kIndigo = {
      {0.10F, 0.085F, 0.08F}, {0.88F, 0.85F, 0.79F}, {0.72F, 0.20F, 0.18F}, {0.16F, 0.18F, 0.42F},
      {0.50F, 0.52F, 0.72F},  {0.62F, 0.12F, 0.12F}, {0.85F, 0.62F, 0.20F}};
  static const Clothes kPlum = {{0.24F, 0.13F, 0.07F}, {0.44F, 0.13F, 0.33F}, {0.92F, 0.80F, 0.50F},
                                {0.56F, 0.26F, 0.13F}, {0.88F, 0.68F, 0.50F}, {0.14F, 0.17F, 0.52F},
                                {0.86F, 0.84F, 0.90F}};
  return palette == Palette::kIndigo ? kIndigo : kPlum;
}

Vector3f skin(const Vector3f& p, uint32_t seed) {
  return Vector3f(0.82F, 0.58F, 0.44F) * grain(p, 90, 0.14F, seed);
}

/// Brows, eyes and mouth. Axes: x forward, y left, z up; origin in the middle of the head.
Vector3f face(const Vector3f& p, uint32_t seed) {
  Vector3f colour = skin(p, seed);
  if (p.x() < 0.03F) {
    return colour;
  }
  const float y = std::abs(p.y());
  const float eye = std::hypot((y - 0.031F) / 0.016F, (p.z() - 0.012F) / 0.0075F);
  const float iris = std::hypot(y - 0.031F, p.z() - 0.012F) / 0.006F;
  const float brow = std::hypot((y - 0.033F) / 0.022F, (p.z() - 0.033F - 0.1F * y) / 0.0055F);
  const float mouth = std::hypot(p.y() / 0.027F, (p.z() + 0.060F) / 0.0065F);
  colour = blend(Vector3f(0.90F, 0.88F, 0.85F), colour, step(0.85F, 1.05F, eye));
  colour = blend(Vector3f(0.08F, 0.05F, 0.04F), colour, step(0.85F, 1.1F, std::max(iris, eye)));
  colour = blend(Vector3f(0.10F, 0.08F, 0.07F), colour, step(0.8F, 1.1F, brow));
  return blend(Vector3f(0.60F, 0.25F, 0.22F), colour, step(0.8F, 1.1F, mouth));
}

Vector3f hair(const Vector3f& p, uint32_t seed, const Clothes& clothes) {
  const float strands = value_noise({p.x() * 60, p.y() * 420, p.z() * 120}, seed);
  return clothes.hair * (0.55F + 0.9F * strands);
}

/// Cotton with a weave and rows of small diamonds.
Vector3f jacket(const Vector3f& p, uint32_t seed, const Clothes& clothes) {
  const float angle = azimuth(p);
  const float row = p.z() / 0.045F;
  const float column = angle * 16 / (2 * std::numbers::pi_v<float>)+0.5F * std::floor(row);
  const float diamond =
      std::abs(row - std::floor(row) - 0.5F) * 1.4F + std::abs(column - std::floor(column) - 0.5F);
  const float weave = 0.03F * std::sin(p.z() * 1400) * std::sin(angle * 220);
  const Vector3f cloth = clothes.jacket * (grain(p, 55, 0.16F, seed) + weave);
  return blend(clothes.diamond, cloth, step(0.20F, 0.27F, diamond));
}

/// Pale pinstripes down the leg.
Vector3f trousers(const Vector3f& p, uint32_t seed, const Clothes& clothes) {
  const float angle = azimuth(p);
  const float stripe = angle * 36 / (2 * std::numbers::pi_v<float>);
  const float off = std::abs(stripe - std::floor(stripe) - 0.5F);
  const Vector3f cloth = clothes.trousers * grain(p, 50, 0.45F, seed);
  return blend(clothes.stripe * grain(p, 80, 0.25F, seed), cloth, step(0.07F, 0.11F, off));
}

Vector3f belt(const Vector3f& p, uint32_t seed, const Clothes& clothes) {
  const float wave = std::sin(p.z() * 500 + 3 * std::sin(8 * azimuth(p)));
  return blend(clothes.belt, clothes.belt_wave, step(0.3F, 0.6F, wave)) * grain(p, 90, 0.2F, seed);
}

Vector3f blade(const Vector3f& p, uint32_t seed) {
  const float temper =
      0.003F + 0.003F * std::sin(p.z() * 190) + 0.003F * value_noise({p.z() * 160, 0, 0}, seed);
  const Vector3f steel =
      Vector3f(0.68F, 0.72F, 0.78F) * grain({p.x(), p.y(), 0.3F * p.z()}, 260, 0.2F, seed);
  return blend(steel, Vector3f(0.96F, 0.97F, 0.98F), step(temper - 0.001F, temper + 0.001F, p.x()));
}

/// Black cord over pale ray skin, in a diamond pattern.
Vector3f handle(const Vector3f& p, uint32_t seed) {
  const float turn = azimuth(p) / (2 * std::numbers::pi_v<float>)*4;
  const float along = p.z() / 0.022F;
  const auto saw = [](float x) { return std::abs(x - std::floor(x) - 0.5F); };
  const float cord = std::min(saw(along + turn), saw(along - turn));
  return blend(Vector3f(0.12F, 0.10F, 0.13F), Vector3f(0.86F, 0.80F, 0.66F),
               step(0.28F, 0.33F, cord)) *
         grain(p, 200, 0.25F, seed);
}

}  // namespace

Vector3f paint(Material material, const Vector3f& place, uint64_t seed, Palette palette) {
  const Clothes& clothes = clothes_of(palette);
  const auto s = static_cast<uint32_t>(mix(seed + static_cast<uint64_t>(material)));
  switch (material) {
    case Material::kSkin:
      return skin(place, s);
    case Material::kFace:
      return face(place, s);
    case Material::kHair:
      return hair(place, s, clothes);
    case Material::kJacket:
      return jacket(place, s, clothes);
    case Material::kTrousers:
      return trousers(place, s, clothes);
    case Material::kBelt:
      return belt(place, s, clothes);
    case Material::kSock:
      return Vector3f(0.90F, 0.89F, 0.86F) * grain(place, 120, 0.18F, s);
    case Material::kBlade:
      return blade(place, s);
    case Material::kHandle:
      return handle(place, s);
    case Material::kGuard:
      return Vector3f(0.42F, 0.30F, 0.14F) * grain(place, 250, 0.6F, s);
  }
  return Vector3f::Zero();
}

}  // namespace v3d::sim
