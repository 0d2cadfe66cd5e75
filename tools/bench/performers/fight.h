// A simulated fight as hulls with the true performer of every vertex.
#pragma once

#include <cstdint>
#include <vector>

#include "base/geometry/camera_model.h"
#include "capture/segmentation/segmenter.h"
#include "recon/pipeline/reconstructor.h"
#include "sim/rendering/camera_images.h"

namespace v3d::bench {

struct FightOptions {
  uint64_t seed = 1;
  int cameras = 15;
  double voxel_m = 0.01;
  double rate_hz = 25;
  bool exact = false;  ///< true silhouettes instead of segmented images
};

struct FightPulse {
  recon::SparseVolume volume;  ///< the visual hull
  /// By vertex of its MarchingCubes surface the performer, 1 or 2, whose true surface is nearest.
  std::vector<uint8_t> truth;
  double live_ms = 0;  ///< processor time of the live reconstruction, without segmentation
};

/// Processor time of this process so far, milliseconds.
double processor_ms();

/// Renders, segments and reconstructs the pulses of a fight of two simulated performers.
class Fight {
 public:
  explicit Fight(const FightOptions& options);
  FightPulse pulse(int number);

 private:
  recon::FrameSet frames(double seconds, int number);

  FightOptions options_;
  Rig rig_;
  sim::BatchRenderer renderer_;
  std::vector<segmentation::Segmenter> segmenters_;
  recon::Reconstructor reconstructor_;
};

}  // namespace v3d::bench
