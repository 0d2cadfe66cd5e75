// Similarity of two augmented multiresolution Reeb graphs, and retrieval by it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "recon/skeleton/reeb_graph.h"

namespace v3d::recon {

/// Similarity of two graphs, from 0 to 1; symmetric; 1 for equal graphs. Graphs without nodes: 0.
///
/// Nodes are matched from coarse to fine: of the same interval, with matched parents, the most
/// alike first. A matched pair adds the smaller of its two shares of area and volume, times how
/// alike its extent, perimeter and position are. The position is the height over the lowest node
/// and the distance from the vertical axis of the body, so that a turn about this axis changes
/// nothing. All levels count equally. Requires the same number of levels. Thread-safe.
///
/// Sources: Hilaga et al., SIGGRAPH 2001, section 5; Tung and Schmitt, IJSM 2005 (attributes).
/// Deviations: docs/skeleton.md.
double graph_similarity(const ReebGraph& a, const ReebGraph& b);

struct SimilarPulse {
  int64_t pulse = 0;
  double similarity = 0;
};

/// The `count` pulses whose graphs are most similar to `query`, best first. `pulses`: that of each
/// graph. Of pulses less than `apart` from one another only the best one is returned.
std::vector<SimilarPulse> most_similar(const ReebGraph& query, std::span<const ReebGraph> graphs,
                                       std::span<const int64_t> pulses, size_t count,
                                       int64_t apart);

}  // namespace v3d::recon
