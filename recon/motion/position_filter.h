// Smoothing of a tracked surface over the pulses.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace v3d::recon {

/// Displacements measured at one pulse, one per vertex, metres along the normal.
struct NormalDisplacements {
  std::vector<float> target, weight;  ///< measured where the weight is more than 0
};

/// Removes noise from the displacements of each vertex: [pulse], ascending; every pulse has the
/// same vertices. They are relative to the graph, which moves with the surface, so noise is
/// distinguished from motion at any speed. Each becomes the mean over the pulses near it in time. A
/// displacement counts less the more pulses it is away and the more it differs from the median of
/// these pulses: so a fold that comes or goes within few pulses stays where most of them have it. A
/// vertex that is seen at some of these pulses alone has their mean.
///
/// Works in the caller's TBB arena. Deterministic: independent of thread count.
std::vector<NormalDisplacements> steady_displacements(std::span<const NormalDisplacements> pulses,
                                                      std::span<const int64_t> numbers);

/// Removes noise from the path of each vertex: [pulse][vertex], world, metres; every pulse has the
/// same vertices. `pulses`: the number of each pulse, ascending.
///
/// Where a vertex stays within its noise, its position becomes the mean of up to nine pulses around
/// it, so that still surface does not flicker. Where it moves, its position becomes that of a
/// parabola through five or seven pulses, as long as the path follows the parabola: steady
/// acceleration is preserved, and a sudden change of speed keeps its pulse. The noise of a vertex
/// is the median residual of parabolas through five pulses. A window has as many pulses on both
/// sides, so smoothing does not lag; the first and last pulse stay as they are. The pulses of a
/// window are evenly spaced, so that a gap of pulses does not look like a change of speed.
///
/// Works in the caller's TBB arena. Deterministic: independent of thread count.
///
/// Source: Savitzky and Golay, Smoothing and differentiation of data by simplified least squares
/// procedures, Analytical Chemistry 1964; the choice of the window by the residual is our own.
void smooth_in_time(std::vector<std::vector<Eigen::Vector3f>>& positions,
                    std::span<const int64_t> pulses);

}  // namespace v3d::recon
