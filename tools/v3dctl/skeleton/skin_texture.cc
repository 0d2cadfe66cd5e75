// Textures of the tracked surfaces that a skeleton moves.
#include <algorithm>
#include <utility>

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

/// Indices of pulses from the first to the last, evenly spaced; then that of the rest pulse.
std::vector<size_t> painted_pulses(const recon::TrackedBody& body) {
  const size_t count = std::min(body.pulses.size(), kPaintedPulses);
  std::vector<size_t> painted;
  for (size_t k = 0; k < count; ++k) {
    const size_t n = count == 1 ? 0 : k * (body.pulses.size() - 1) / (count - 1);
    if (n != body.rest) painted.push_back(n);
  }
  painted.push_back(body.rest);
  return painted;
}

}  // namespace

std::vector<recon::TextureAtlas> skin_textures(const TakeSkeleton& skeleton,
                                               TexturePainter& painter, int side) {
  std::vector<recon::TextureAtlas> textures(skeleton.tracked.size());
  for (size_t b = 0; b < textures.size(); ++b) {
    if (skeleton.skins[b].influences.empty()) continue;
    const recon::TrackedBody& body = skeleton.tracked[b];
    textures[b].layout = painter.layout_of(body.surface, side);
    recon::AtlasFilter filter;
    for (const size_t n : painted_pulses(body)) {
      stop_if_interrupted();
      recon::AtlasColours colours =
          painter.paint(surface_at(body, n), textures[b].layout, body.pulses[n]);
      filter.apply(colours);
      textures[b].image = std::move(colours.image);
    }
  }
  return textures;
}

}  // namespace v3d::ctl
