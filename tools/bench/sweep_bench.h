// Benchmark sweep over resolutions, cameras and threads.
#pragma once

namespace v3d::bench {

/// Adds sweep/intersect/voxel_mm:V/cameras:C/threads:T and sweep/mesh/voxel_mm:V/threads:T: voxels
/// of 2 to 20 mm before 15 cameras, 4 to 60 cameras at 8 mm, 1 thread to all cores. For
/// tools/bench/plot.
void register_sweep();

}  // namespace v3d::bench
