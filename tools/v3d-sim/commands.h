// The commands of v3d-sim. Each function adds a command, which writes its exit status to `status`
// when it is run.
#pragma once

#include <CLI/CLI.hpp>

namespace v3d::sim {

void add_take_command(CLI::App& app, int& status);
void add_studio_command(CLI::App& app, int& status);
void add_check_command(CLI::App& app, int& status);

}  // namespace v3d::sim
