// Command line options that several commands of v3d-sim share.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>

#include "base/config/calib_file.h"

namespace v3d::sim {

/// Parameters of the simulated studio.
struct StudioOptions {
  int cameras = 15;
  std::string size = "1024x768";
  uint64_t seed = 1;
  double rate_hz = 25;
};

/// Adds --cameras, --size, --seed and --rate.
void add_studio_options(CLI::App& command, StudioOptions& options);

/// The rig of the studio. Throws InputError for an invalid image size.
Rig rig_of(const StudioOptions& options);

}  // namespace v3d::sim
