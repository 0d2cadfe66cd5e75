// The workload every benchmark runs on: the simulated performer before 15 cameras of 1024x768, a
// space of 3 x 3 x 2 m, one seed.
#pragma once

#include <vector>

#include "base/geometry/box.h"
#include "base/geometry/camera_model.h"
#include "base/image/frame.h"
#include "capture/segmentation/segmenter.h"
#include "recon/hull/intersect.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/pipeline/reconstructor.h"

namespace v3d::bench {

inline constexpr int kCameras = 15;
inline constexpr ImageSize kSize{1024, 768};
inline constexpr uint64_t kSeed = 1;
inline constexpr int kMinViews = 4;
inline constexpr int kPlates = 8;               ///< of the empty studio
inline constexpr double kInstantSeconds = 1.5;  ///< of raw_frames(), in the cut

/// The space the paper reconstructs.
Box space();

const Rig& rig();

/// One raw frame per camera, in the middle of the cut.
const std::vector<Image>& raw_frames();

/// What the camera saw of the empty studio beforehand.
const std::vector<Image>& plates(int camera);

/// Learnt from plates().
const std::vector<BackgroundModel>& background_models();

/// What the segmentation makes of raw_frames().
const std::vector<Mask>& masks();

/// Borrowed from `masks`.
std::vector<const Mask*> pointers_to(const std::vector<Mask>& masks);

/// Empty space with the benchmark's cameras round it, ready to intersect.
Intersector intersector(double voxel_m);
/// The volume of masks().
SparseVolume volume(double voxel_m);

/// raw_frames() and masks() as they reach the reconstruction.
const FrameSet& frame_set();

/// frame_set() reconstructed at 10 mm, as it travels and as it is read.
const std::vector<uint8_t>& compact_10mm();
const CompactFrame& compact_frame_10mm();

ReconstructOptions options(double voxel_m, int threads);

}  // namespace v3d::bench
