// Colours of a texture atlas, from the photographs of one pulse.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"
#include "base/image/image.h"
#include "recon/texture/texture.h"
#include "recon/texture/texture_atlas.h"

namespace v3d::recon {

// Temporal filter of colours: less noise at places of a surface that are followed over the pulses.

/// Steadies the colours of successive pulses at the same places, such as texels of one layout or
/// vertices of one tracked surface. A place follows small changes, such as noise and cameras that
/// fade in and out, by a seventh a pulse. It follows changes of 40 grey values or more at once, so
/// that no wrong colour stays. A place that no camera sees any more keeps its colour, and one that
/// a camera sees for the first time has that colour at once. One thread.
class ColourFilter {
 public:
  /// Replaces the colours of the next pulse: red, green and blue of each place. `seen`: for each
  /// place, 0 where no camera sees it. All pulses have the same places.
  void apply(std::span<uint8_t> colours, std::span<const uint8_t> seen);
  /// The same for the vertices of a surface. A pulse without colours is left out.
  void apply(std::vector<Rgb8>& colours, std::span<const uint8_t> seen);

 private:
  std::vector<float> shown_;  ///< red, green and blue of every place so far
  std::vector<uint8_t> was_seen_;
};

// Colours of an atlas.

struct AtlasColourOptions {
  TextureOptions sampling;  ///< `view` and `fill_passes` are ignored
  /// The surface that may hide the mesh from a camera, borrowed; null: the mesh itself.
  const Mesh* occluder = nullptr;
  /// Exponent of the weights of equation (8) and (9) for details. 1 blends them like the rest.
  float detail_sharpness = 4;
  /// Standard deviation of the filter that separates details from the rest, pixels of a camera; 0
  /// blends everything alike.
  float detail_px = 3;
  /// Width of the band in which a camera fades out towards the border of what it sees, edges of
  /// the mesh.
  int fade_edges = 4;
};

struct AtlasColours {
  Image image;                ///< RGB8
  int64_t texels = 0;         ///< that show the surface
  int64_t unseen = 0;         ///< of them, those that no camera sees
  std::vector<uint8_t> seen;  ///< row by row: 1 for texels that a camera sees
};

/// Colours of all texels of the layout of `mesh`, which has colours of vertices. Source: the paper,
/// Algorithm 1 with equations (8) and (9) for every texel instead of every vertex.
///
/// Additions to the paper: the photographs are divided into a blurred image and details. The
/// blurred image is blended like vertices, so that differences in brightness between cameras make
/// no seams. Details come from the cameras with the greatest weights, so that errors of calibration
/// and shape do not blur them. (Two bands of Burt and Adelson, A multiresolution spline with
/// application to image mosaics, ACM TOG 1983.) A camera fades out towards the border of the
/// surface that it sees.
///
/// Texels that no camera sees take the interpolated colours of vertices; texels without a surface
/// the mean of their surroundings. Deterministic: independent of thread count.
AtlasColours colour_atlas(const Mesh& mesh, const AtlasLayout& layout,
                          std::span<const TextureCamera> cameras,
                          const AtlasColourOptions& options);

/// Steadies the textures of successive pulses that have one layout, by ColourFilter. One thread.
class AtlasFilter {
 public:
  /// Replaces the colours of the next pulse. All pulses have the same size.
  void apply(AtlasColours& colours) { filter_.apply(colours.image.bytes, colours.seen); }

 private:
  ColourFilter filter_;  ///< of the texels
};

}  // namespace v3d::recon
