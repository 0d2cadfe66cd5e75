// Textures of the tracked surfaces that a skeleton moves.
#include <algorithm>
#include <functional>
#include <utility>
#include <vector>

#include "common/console.h"
#include "recon/texture/atlas_colours.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::ctl {
namespace {

constexpr size_t kPaintedPulses = 12;  ///< at most, of a segment

/// The surface at a pulse of its segment, by its index.
Mesh surface_at(const recon::TrackedBody& body, size_t n) {
  Mesh mesh;
  mesh.triangles = body.surface.triangles;
  mesh.vertices = body.positions[n];
  mesh.colours = body.colours[n];
  return mesh;
}

/// Indices of pulses from the first to the last, evenly spaced, without the rest pulse.
std::vector<size_t> pulses_beside_rest(const recon::TrackedBody& body) {
  const size_t count = std::min(body.pulses.size(), kPaintedPulses);
  std::vector<size_t> painted;
  for (size_t k = 0; k < count; ++k) {
    const size_t n = count == 1 ? 0 : k * (body.pulses.size() - 1) / (count - 1);
    if (n != body.rest) painted.push_back(n);
  }
  return painted;
}

/// Gives texels that no camera sees the colours of `other`, where a camera sees them there.
void fill_unseen(recon::AtlasColours& colours, const recon::AtlasColours& other) {
  for (size_t i = 0; i < other.seen.size(); ++i) {
    if (colours.seen[i] != 0 || other.seen[i] == 0) continue;
    std::copy_n(other.image.bytes.begin() + static_cast<std::ptrdiff_t>(3 * i), 3,
                colours.image.bytes.begin() + static_cast<std::ptrdiff_t>(3 * i));
  }
}

/// Paints the surfaces of a body at its pulses.
class BodyPainter {
 public:
  BodyPainter(const recon::TrackedBody& body, const recon::AtlasLayout& layout,
              TexturePainter& painter)
      : body_(body), layout_(layout), painter_(painter) {}

  /// The texture at the rest pulse, completed by those of other pulses.
  Image texture() {
    const recon::AtlasColours others = colours_beside_rest();
    recon::AtlasColours rest = paint(body_.rest);
    fill_unseen(rest, others);
    return std::move(rest.image);
  }

 private:
  /// Steadied colours. `seen`: at any of the pulses.
  recon::AtlasColours colours_beside_rest() {
    recon::AtlasColours result;
    recon::AtlasFilter filter;
    for (const size_t n : pulses_beside_rest(body_)) {
      recon::AtlasColours colours = paint(n);
      filter.apply(colours);
      result.image = std::move(colours.image);
      result.seen.resize(colours.seen.size(), 0);
      std::ranges::transform(result.seen, colours.seen, result.seen.begin(), std::bit_or<>());
    }
    return result;
  }

  recon::AtlasColours paint(size_t n) {
    stop_if_interrupted();
    return painter_.paint(surface_at(body_, n), layout_, body_.pulses[n]);
  }

  const recon::TrackedBody& body_;
  const recon::AtlasLayout& layout_;
  TexturePainter& painter_;
};

}  // namespace

std::vector<recon::TextureAtlas> skin_textures(const TakeSkeleton& skeleton,
                                               TexturePainter& painter, int side) {
  std::vector<recon::TextureAtlas> textures(skeleton.tracked.size());
  for (size_t b = 0; b < textures.size(); ++b) {
    if (skeleton.skins[b].influences.empty()) continue;
    const recon::TrackedBody& body = skeleton.tracked[b];
    textures[b].layout = painter.layout_of(body.surface, side);
    textures[b].image = BodyPainter(body, textures[b].layout, painter).texture();
  }
  return textures;
}

}  // namespace v3d::ctl
