// Which pictures of a board are worth calibrating with: few, and as different as can be.
#pragma once

#include <span>
#include <vector>

#include "base/image.h"
#include "calib/boards/board.h"

namespace v3d::calib {

/// Indices of at most `most` sightings, rising: well spread over the image, over distances and over
/// the directions in which the board leans. The fullest sighting first, then always the one that is
/// most unlike all chosen before (farthest-point selection); near copies of a chosen one never.
/// Deterministic.
std::vector<int> choose_views(const Board& board, ImageSize size,
                              std::span<const BoardSighting* const> sightings, int most);

/// The part of the image, 0 to 1, in which corners were seen: of kCoverageColumns x kCoverageRows
/// equal fields those with at least one.
inline constexpr int kCoverageColumns = 10;
inline constexpr int kCoverageRows = 8;
double coverage(ImageSize size, std::span<const BoardSighting* const> sightings);
/// The corners in each field, row by row.
std::vector<int> coverage_counts(ImageSize size, std::span<const BoardSighting* const> sightings);

}  // namespace v3d::calib
