// The workload every benchmark runs on: the simulated performer before 15 cameras of 1024x768, a
// space of 3 x 3 x 2 m, one seed.
#pragma once

#include <vector>

#include "base/camera_model.h"
#include "base/frame.h"
#include "capture/segmenter.h"
#include "recon/reconstructor.h"

namespace v3d::bench {

inline constexpr int kCameras = 15;
inline constexpr ImageSize kSize{1024, 768};
inline constexpr uint64_t kSeed = 1;

/// The space the paper reconstructs.
Box space();

const Rig& rig();

/// One raw frame per camera, in the middle of the cut.
const std::vector<Image>& raw_frames();

const std::vector<BackgroundModel>& background_models();

/// What the segmentation makes of raw_frames().
const std::vector<Mask>& masks();

/// raw_frames() and masks() as they reach the reconstruction.
const FrameSet& frame_set();

ReconstructOptions options(double voxel_m, int threads);

}  // namespace v3d::bench
