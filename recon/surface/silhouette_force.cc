#include "recon/surface/silhouette_force.h"

#include <cmath>
#include <cstring>

#include "base/image/mask_morphology.h"

namespace v3d {
namespace {

using Eigen::Vector2f;

// In pixels of SurfaceCamera::picture(0).
constexpr float kOutlinePixels = 2;  ///< a vertex farther from the mesh's outline is not on it
constexpr float kSearchPixels = 8;   ///< how far the observed outline may be
constexpr float kStepPixels = 0.25F;
constexpr float kProbeMetres = 0.005F;

/// Signed distance from `from` along `direction` to the nearest change of `inside`: outwards from
/// an inner pixel, inwards from an outer one. `direction` has the length of one pixel of
/// picture(0), and so has the unit of the result.
template <class Inside>
std::optional<float> outline_along(const Vector2f& from, const Vector2f& direction, float reach,
                                   const Inside& inside) {
  const bool here = inside(from);
  const float sign = here ? 1.0F : -1.0F;
  for (float t = kStepPixels; t <= reach; t += kStepPixels) {
    if (inside(from + sign * t * direction) != here) return sign * (t - kStepPixels / 2);
  }
  return std::nullopt;
}

bool deep_inside(const Vector2f& pixel, ImageSize size, float room) {
  return pixel.x() >= room && pixel.y() >= room &&
         pixel.x() < static_cast<float>(size.width) - room &&
         pixel.y() < static_cast<float>(size.height) - room;
}

/// Packs eight bytes, each 0 or 1, into the bits of one byte; the first byte becomes the lowest
/// bit.
uint64_t bits_of_bytes(const uint8_t* bytes) {
  uint64_t word = 0;
  std::memcpy(&word, bytes, sizeof word);
  return word * 0x0102'0408'1020'4080 >> 56;  // byte i times 2^(56 - 7 i) is bit 56 + i
}

Mask drawn_pixels(const DepthBuffer& depth) {
  Mask drawn(depth.size);
  std::vector<uint8_t> finite(64 * static_cast<size_t>(drawn.words_per_row()), 0);
  for (int y = 0; y < depth.size.height; ++y) {
    const float* z = depth.z.data() + static_cast<size_t>(y) * depth.size.width;
    for (int x = 0; x < depth.size.width; ++x) finite[x] = std::isfinite(z[x]);
    const std::span<uint64_t> row = drawn.row(y);
    for (size_t byte = 0; byte < finite.size() / 8; ++byte) {
      row[byte / 8] |= bits_of_bytes(&finite[8 * byte]) << (byte % 8 * 8);
    }
  }
  return drawn;
}

}  // namespace

Mask near_outline(const SurfaceCamera& camera, const DepthBuffer& depth) {
  const int radius = static_cast<int>(std::ceil(kOutlinePixels * camera.coarseness()));
  const Mask drawn = drawn_pixels(depth);
  if (radius <= kMaxRadius) return difference_of(dilate(drawn, radius), erode(drawn, radius));
  Mask anywhere(depth.size);
  for (int y = 0; y < depth.size.height; ++y) anywhere.fill_row(y, 0, depth.size.width);
  return anywhere;
}

std::optional<float> silhouette_displacement(const SurfaceCamera& camera, const DepthBuffer& depth,
                                             const Eigen::Vector3f& place,
                                             const Eigen::Vector3f& normal,
                                             const SurfaceCamera::Seen& seen) {
  const float room = (kSearchPixels + 1) * camera.coarseness();
  if (!deep_inside(seen.pixel, depth.size, room)) return std::nullopt;
  const auto beside = camera.project(place + kProbeMetres * normal);
  if (!beside) return std::nullopt;
  const Vector2f across = beside->pixel - seen.pixel;
  const float length = across.norm() / camera.coarseness();
  if (!(length > 0)) return std::nullopt;
  const Vector2f direction = across / length;
  const auto drawn = [&](const Vector2f& p) {
    return std::isfinite(depth.at(static_cast<int>(p.x()), static_cast<int>(p.y())));
  };
  const auto drawn_at = outline_along(seen.pixel, direction, kOutlinePixels, drawn);
  if (!drawn_at) return std::nullopt;
  const auto observed = [&](const Vector2f& p) { return camera.in_silhouette(p); };
  const auto observed_at = outline_along(seen.pixel, direction, kSearchPixels, observed);
  if (!observed_at) return std::nullopt;
  return (*observed_at - *drawn_at) * (kProbeMetres / length);
}

}  // namespace v3d
