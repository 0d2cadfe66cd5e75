// What the commands of v3d-sim share on their command lines.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>

#include "base/image.h"

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

/// "1024x768"; sides from 16 to 8192, even (a filter mosaic is 2x2). Throws InputError.
ImageSize parse_size(const std::string& text);

}  // namespace v3d::sim
