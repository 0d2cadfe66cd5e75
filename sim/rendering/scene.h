// The simulated studio: performer, rig and camera images. Deterministic: equal seeds give equal
// bytes on every machine.
#pragma once

#include <cstdint>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/image/image.h"
#include "base/image/mask.h"
#include "sim/performer/performer.h"

namespace v3d::sim {

/// The rig of the paper's studio (6 m wide, 2.5 m high), with cameras on the wall at several
/// heights.
///
/// All cameras look at the space of 3 x 3 x 2 m in the middle. Every fourth camera has a narrow
/// field of view; the others see the whole body.
Rig make_rig(int cameras, ImageSize size, uint64_t seed);

/// The true surface of the performer (world frame, metres, with vertex colours): body, clothes,
/// sword.
///
/// It consists of closed parts that overlap; sim/performer/performer.h gives their visible
/// surface. `seconds`: any time; the action has the period kActionPeriodSeconds.
Mesh performer_at(double seconds, uint64_t seed);
inline constexpr double kActionPeriodSeconds = 4.0;

struct RenderOptions {
  PixelFormat format = PixelFormat::kBayerRG8;
  uint64_t seed = 1;
  double noise = 1.5;  ///< standard deviation, grey values
  double exposure_s = 0.001;
  double colour_spread = 0;  ///< colour difference between cameras (noise.h)
  std::vector<Performer> cast = {Performer{}};
};

/// One camera image. `seconds`: time of the middle of the exposure. `with_performer` false: a
/// background plate. `exposure_number` seeds the noise.
///
/// Renders the background for each call; use sim/rendering/camera_images.h for many images.
Image render(const RigCamera& camera, double seconds, bool with_performer, uint64_t exposure_number,
             const RenderOptions& options);

/// The exact silhouette of all performers in `camera`; `performers` as for cast_of().
Mask true_silhouette(const RigCamera& camera, double seconds, uint64_t seed, int performers = 1);

}  // namespace v3d::sim
