#include "v3d-sim/options.h"

#include "base/image/image_size.h"
#include "common/pulse_rate_option.h"
#include "sim/rendering/scene.h"

namespace v3d::sim {

void add_studio_options(CLI::App& command, StudioOptions& options) {
  command.add_option("--cameras", options.cameras, "Number of cameras")
      ->check(CLI::Range(1, 200))
      ->capture_default_str();
  command.add_option("--size", options.size, "Image size in pixels, WIDTHxHEIGHT")
      ->capture_default_str();
  command.add_option("--seed", options.seed, "Random seed; equal seeds give equal bytes")
      ->capture_default_str();
  command.add_option("--rate", options.rate_hz, "Pulses per second")
      ->check(check_pulse_rate)
      ->capture_default_str();
}

Rig rig_of(const StudioOptions& options) {
  return make_rig(options.cameras, parse_size(options.size, Sides::kEven), options.seed);
}

}  // namespace v3d::sim
