// View selection: a small, diverse subset of board images for calibration, and image coverage.
#pragma once

#include <span>
#include <vector>

#include "base/image/image.h"
#include "calib/boards/board.h"

namespace v3d::calib {

/// Indices, in ascending order, of at most `max_views` observations that differ most in image
/// position, distance and tilt (farthest-point selection).
///
/// The observation with most corners comes first, then always the one that is farthest from all
/// selected ones. Near duplicates are never selected. Deterministic.
std::vector<int> select_views(const Board& board, ImageSize size,
                              std::span<const BoardObservation* const> observations, int max_views);

/// The share of the image, 0 to 1, in which corners were observed: of kCoverageColumns x
/// kCoverageRows equal cells, those with at least one corner.
inline constexpr int kCoverageColumns = 10;
inline constexpr int kCoverageRows = 8;
double coverage(ImageSize size, std::span<const BoardObservation* const> observations);
/// The number of corners in each cell, row by row.
std::vector<int> coverage_counts(ImageSize size,
                                 std::span<const BoardObservation* const> observations);

}  // namespace v3d::calib
