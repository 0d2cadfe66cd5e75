// The commands of v3d-sim. Each adds itself to the command line and leaves its exit status in
// `status` when it is the one that was called.
#pragma once

#include <CLI/CLI.hpp>

namespace v3d::sim {

void add_take_command(CLI::App& app, int& status);
void add_studio_command(CLI::App& app, int& status);
void add_check_command(CLI::App& app, int& status);

}  // namespace v3d::sim
