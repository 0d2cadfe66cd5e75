// Colour of a vertex from its samples in all cameras: outlier rejection, and inpainting over the
// mesh where no sample is sure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/texture/accumulate_colours.h"

namespace v3d::recon {

// Loose silhouettes contain a rim of the room. A sample near the outline may have its colour; one
// deep inside cannot. So deep samples decide where there are any, else the neighbours on the mesh.

enum class ColourTrust : uint8_t {
  kUnseen = 0,    ///< no camera sees the vertex
  kDoubtful = 1,  ///< all samples are near an outline: the colour may be the room's
  kTrusted = 2
};

struct VertexColours {
  explicit VertexColours(size_t vertices);
  std::vector<Rgb8> colours;  ///< kUnseenColour where unseen
  std::vector<ColourTrust> trust;
};

/// Sets the colours of the block of vertices that begins at `first`.
///
/// The colour is the weighted mean of the deep samples and of the inner ones. The inner ones are
/// left out where they contradict the deep ones: the means differ by more than 30 grey values in a
/// channel, and the inner ones have at most twice the weight. Without deep samples the colour is
/// doubtful: the mean of the inner ones, or of the rim. Thread-safe for different blocks.
void decide_colours(const ColourSums& sums, size_t first, VertexColours& vertices);

/// Spreads trusted colours over the edges of the mesh, at most `passes` edges far.
///
/// An unseen vertex takes the mean of its trusted neighbours. So does a doubtful one within 12
/// edges, if its colour differs by more than 15 grey values in a channel; farther away it keeps its
/// colour, as on a thin object that no camera sees deep. Deterministic; one thread.
void spread_colours(const Mesh& mesh, int passes, VertexColours& vertices);

}  // namespace v3d::recon
