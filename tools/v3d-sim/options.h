// What the commands of v3d-sim share on their command lines.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>

#include "base/calib_file.h"

namespace v3d::sim {

/// The simulated studio to build.
struct StudioOptions {
  int cameras = 15;
  std::string size = "1024x768";
  uint64_t seed = 1;
  double rate_hz = 25;
};

/// --cameras --size --seed --rate.
void add_studio_options(CLI::App& command, StudioOptions& options);

/// Its cameras. Throws InputError when their size is none.
Rig rig_of(const StudioOptions& options);

}  // namespace v3d::sim
