// Smoothing of a tracked surface over the pulses.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace v3d::recon {

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
