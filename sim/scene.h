// The simulated studio: a performer, a rig, and the pictures the cameras would take. Deterministic:
// the same seed gives the same bytes on every machine.
#pragma once

#include <cstdint>
#include <vector>

#include "base/camera_model.h"
#include "base/image.h"
#include "base/mask.h"
#include "base/mesh.h"

namespace v3d::sim {

/// The paper's studio: 6 m across, 2.5 m high; cameras on its wall at several heights, most see the
/// whole body, every fourth a close-up of a part. All look at the 3 x 3 x 2 m space in the middle.
Rig make_rig(int cameras, ImageSize size, uint64_t seed);

/// The performer's surface at a time: body, waving clothes, sword. Closed parts, world frame, with
/// vertex colours; the true surface. Parts overlap: what can be seen from outside is
/// sim/outer_surface.h. Any time; the action repeats smoothly every kActionPeriodSeconds.
Mesh performer_at(double seconds, uint64_t seed);
inline constexpr double kActionPeriodSeconds = 4.0;

struct RenderOptions {
  PixelFormat format = PixelFormat::kBayerRG8;
  uint64_t seed = 1;
  double noise = 1.5;  ///< standard deviation, grey values
  double exposure_s = 0.001;
  double colour_spread = 0;  ///< how much the colours of the cameras differ (sensor_colour.h)
};

/// What `camera` sees at `seconds`, the middle of the exposure; with_performer = false gives a
/// background plate. `exposure_number` seeds the noise. Draws the camera's room first, which takes
/// longer than the performer: for many images see sim/film.h.
Image render(const RigCamera& camera, double seconds, bool with_performer, uint64_t exposure_number,
             const RenderOptions& options);

/// The exact silhouette of the performer in `camera`.
Mask true_silhouette(const RigCamera& camera, double seconds, uint64_t seed);

}  // namespace v3d::sim
