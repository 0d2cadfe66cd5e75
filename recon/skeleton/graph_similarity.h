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
  size_t index = 0;  ///< of the graph in the list
  double similarity = 0;
};

/// The `count` graphs most similar to `query`, best first. Of neighbours less than `apart` places
/// from one another in the list only the best one is returned.
std::vector<SimilarPulse> most_similar(const ReebGraph& query, std::span<const ReebGraph> graphs,
                                       size_t count, size_t apart);

}  // namespace v3d::recon
