// Common workload of the benchmarks: the simulated performer, 15 cameras of 1024x768, a space of
// 3 x 3 x 2 m, one seed.
#pragma once

#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/frame.h"
#include "capture/segmentation/segmenter.h"
#include "recon/hull/intersect.h"
#include "recon/pipeline/compact_frame.h"
#include "recon/pipeline/reconstructor.h"
#include "sim/rendering/camera_images.h"

namespace v3d::bench {

inline constexpr int kCameras = 15;
inline constexpr ImageSize kSize{1024, 768};
inline constexpr uint64_t kSeed = 1;
inline constexpr int kMinViews = 4;
inline constexpr int kPlates = 8;               ///< images of the empty studio, for each camera
inline constexpr double kInstantSeconds = 1.5;  ///< time of raw_frames(), in the cut of the sword

/// The reconstructed space of the paper, metres.
Box space();

const Rig& rig();

/// One raw frame per camera, in the middle of the cut.
const std::vector<Image>& raw_frames();

/// Images of the empty studio by this camera.
const std::vector<Image>& plates(int camera);

/// Background models of all cameras, learnt from plates().
const std::vector<segmentation::BackgroundModel>& background_models();

/// Segmenters of the cameras of `studio`, in its order, learnt from kPlates images of the empty
/// studio.
std::vector<segmentation::Segmenter> learnt_segmenters(sim::BatchRenderer& studio);

/// Segmented silhouettes of raw_frames().
const std::vector<Mask>& masks();

/// Pointers to the elements of `masks`.
std::vector<const Mask*> pointers_to(const std::vector<Mask>& masks);

/// Intersector of the space with the benchmark's cameras.
recon::Intersector intersector(double voxel_m);
/// The visual hull of masks().
recon::SparseVolume volume(double voxel_m);

/// raw_frames() and masks() in the form that the reconstruction receives.
const recon::FrameSet& frame_set();

/// frame_set() reconstructed at 10 mm, as encoded bytes and decoded.
const std::vector<uint8_t>& compact_10mm();
const recon::CompactFrame& compact_frame_10mm();

recon::ReconstructOptions options(double voxel_m, int threads);

}  // namespace v3d::bench
